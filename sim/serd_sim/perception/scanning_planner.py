"""A planner that detects people in the lidar scans of its world only."""

from typing import TYPE_CHECKING

from serd_bag.nearest import choice_rule
from serd_sim.errors import SimError
from serd_sim.perception.scan_people import ScanPerception
from serd_sim.planning.dwa import DwaPlanner
from serd_sim.planning.local_planner import RecoveringPlanner, make_planner
from serd_sim.world.command import Command
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint

if TYPE_CHECKING:  # it imports PyBullet
    from serd_sim.world.world import HallwayWorld

#: Source of people: as the world gives them, or from the lidar's scans alone.
PEOPLE_SOURCES = ("given", "scan")


class ScanningPlanner(RecoveringPlanner):
    """A planner with recoveries, for which people as given are replaced by those in the scans."""

    def __init__(self, world: "HallwayWorld") -> None:
        self._world, self._perception = world, ScanPerception(world.scenario)
        super().__init__(DwaPlanner(world.scenario), world.scenario)

    def reset(self) -> None:
        """Discard all state, at the start of an episode."""
        super().reset()
        self._perception.reset()

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """The planner's command for the people the scans have shown."""
        if self._world.is_scan_tick:
            self._perception.take(observation, self._world.scan(observation))
        return super().step(self._perception.see(observation), waypoint)


def require_people_source(name: str) -> None:
    """SimError with the nearest name when `name` is none of PEOPLE_SOURCES."""
    if name not in PEOPLE_SOURCES:
        raise SimError(choice_rule("people_from", name, PEOPLE_SOURCES))


def planner_in_world(world: "HallwayWorld", people_from: str = "given") -> RecoveringPlanner:
    """A planner that drives in a world with people from the given source."""
    require_people_source(people_from)
    return ScanningPlanner(world) if people_from == "scan" else make_planner(world.scenario)
