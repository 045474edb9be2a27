"""Local planners by name."""

from collections.abc import Callable

from sim.errors import SimError
from sim.perception.scan_people import ScanPerception
from sim.perception.scanning_planner import Scanner, ScanningPlanner, scans_of
from sim.planning.dwa import DwaPlanner
from sim.planning.local_planner import LocalPlanner
from sim.planning.mppi import MppiPlanner
from sim.planning.recovery import RecoveringPlanner
from sim.scenario.scenario import Scenario
from storage.nearest import hint, nearest_name

#: Source of people: as the world gives them, or from the lidar's scans alone.
PEOPLE_SOURCES = ("given", "scan")
_PLANNERS: dict[str, Callable[[Scenario], LocalPlanner]] = {"dwa": DwaPlanner, "mppi": MppiPlanner}


def planner_names() -> tuple[str, ...]:
    """Names that `make_planner` accepts."""
    return tuple(_PLANNERS)


def make_planner(name: str, scenario: Scenario) -> RecoveringPlanner:
    """A planner for the scenario's walls and robot, with its parameters and recoveries."""
    if name not in _PLANNERS:
        meant = nearest_name(name, planner_names()) or planner_names()[0]
        raise SimError(
            f"planner must be one of {', '.join(_PLANNERS)}, got {name!r}; did you mean {meant!r}?"
        )
    return RecoveringPlanner(_PLANNERS[name](scenario), scenario)


def require_people_source(name: str) -> None:
    """SimError with the nearest name when `name` is none of PEOPLE_SOURCES."""
    if name not in PEOPLE_SOURCES:
        raise SimError(
            f"people_from must be one of {', '.join(PEOPLE_SOURCES)}, got {name!r}; "
            f"{hint(name, PEOPLE_SOURCES)}"
        )


def planner_in_world(
    name: str, world: Scanner, people_from: str = "given"
) -> RecoveringPlanner | ScanningPlanner:
    """A planner that drives in a world with people from the given source."""
    require_people_source(people_from)
    planner = make_planner(name, world.scenario)
    if people_from == "given":
        return planner
    return ScanningPlanner(planner, ScanPerception(world.scenario), scans_of(world))
