"""Local planners by name."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from serd_bag.nearest import choice_rule
from serd_sim.errors import SimError
from serd_sim.perception.scan_people import ScanPerception
from serd_sim.perception.scanning_planner import ScanningPlanner
from serd_sim.planning.dwa import WINDOW_S, DwaPlanner
from serd_sim.planning.local_planner import LocalPlanner, RecoveringPlanner
from serd_sim.planning.mppi import MppiPlanner
from serd_sim.scenario.scenario import Scenario

if TYPE_CHECKING:  # it imports PyBullet
    from serd_sim.world.world import HallwayWorld

#: Source of people: as the world gives them, or from the lidar's scans alone.
PEOPLE_SOURCES = ("given", "scan")
_PLANNERS: dict[str, Callable[[Scenario], LocalPlanner]] = {
    "dwa": DwaPlanner,
    "dwa_smooth": partial(DwaPlanner, approach_s=WINDOW_S),
    "mppi": MppiPlanner,
}


def planner_names() -> tuple[str, ...]:
    """Names that `make_planner` accepts."""
    return tuple(_PLANNERS)


def make_planner(name: str, scenario: Scenario) -> RecoveringPlanner:
    """A planner for the scenario's walls and robot, with its parameters and recoveries."""
    if name not in _PLANNERS:
        raise SimError(choice_rule("planner", name, _PLANNERS))
    return RecoveringPlanner(_PLANNERS[name](scenario), scenario)


def require_people_source(name: str) -> None:
    """SimError with the nearest name when `name` is none of PEOPLE_SOURCES."""
    if name not in PEOPLE_SOURCES:
        raise SimError(choice_rule("people_from", name, PEOPLE_SOURCES))


def planner_in_world(
    name: str, world: "HallwayWorld", people_from: str = "given"
) -> RecoveringPlanner:
    """A planner that drives in a world with people from the given source."""
    require_people_source(people_from)
    planner = make_planner(name, world.scenario)
    if people_from == "given":
        return planner
    return ScanningPlanner(
        planner.planner,
        world.scenario,
        ScanPerception(world.scenario),
        lambda seen: world.scan(seen) if world.is_scan_tick else None,
    )
