"""Scenarios with a physical robot, built in or a variant of it, and when it stands."""

from serd_sim.robot.urdf import BUILTIN_URDF
from serd_sim.scenario.scenario import Scenario, load_scenario

#: Below it the physical robot stands; it rocks on its casters.
STOPPED_MPS = 1e-3


def physical(scenario: str = "hallway", people: int = 0, **robot: object) -> Scenario:
    """A built-in scenario with the physical drive; robot: other values of its settings."""
    place = load_scenario(scenario).with_pedestrian_count(people)
    settings = place.robot.model_dump() | {"drive": "physical"} | robot
    return Scenario.model_validate(place.model_dump() | {"robot": settings})


def urdf_with(folder, *changes: tuple[str, str]):
    """Path of the built-in URDF with pieces of its text replaced, each of which must be there."""
    text = BUILTIN_URDF.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    path = folder / "changed.urdf"
    path.write_text(text, encoding="utf-8")
    return path
