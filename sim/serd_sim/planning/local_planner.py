"""The interface of local planners, which turn observations and waypoints into commands."""

from enum import IntEnum
from typing import Protocol

from serd_sim.world.command import Command
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint


class PlannerStatus(IntEnum):
    """NONE: no error; the others are the error codes of nav2_msgs/FollowPath."""

    NONE = 0
    PATIENCE_EXCEEDED = 104
    FAILED_TO_MAKE_PROGRESS = 105
    NO_VALID_CONTROL = 106


class LocalPlanner(Protocol):
    """Drives to waypoints around people; used by the node, batch runs and tests alike."""

    @property
    def is_blocked(self) -> bool:
        """Whether every motion was forbidden at the last step."""

    def reset(self) -> None:
        """Discard all state, at the start of an episode."""

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """Command for the next control period; without a waypoint, stand still."""
