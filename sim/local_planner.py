"""What every local planner is: a thing that turns what is seen and a waypoint into a command."""

from typing import Protocol

from sim.command import Command
from sim.observation import Observation
from sim.waypoint import Waypoint


class LocalPlanner(Protocol):
    """Drives to waypoints around people; one object for the node, batch runs and tests."""

    @property
    def is_blocked(self) -> bool:
        """Whether every way to move was forbidden when it was asked last."""
        ...

    def reset(self) -> None:
        """Forget the past, at the start of an episode."""
        ...

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """Command for the next control period; without a waypoint, stand still."""
        ...
