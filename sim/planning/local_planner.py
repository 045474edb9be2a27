"""What every local planner is: a thing that turns what is seen and a waypoint into a command."""

from typing import Any, Protocol

from sim.world.command import Command
from sim.world.observation import Observation
from sim.world.waypoint import Waypoint


class LocalPlanner(Protocol):
    """Drives to waypoints around people; one object for the node, batch runs and tests."""

    @property
    def is_blocked(self) -> bool:
        """Whether every way to move was forbidden when it was asked last."""
        ...

    def reset(self) -> None:
        """Forget the past, at the start of an episode."""
        ...

    def snapshot(self) -> Any:
        """Everything that changes, as a value of the planner's own kind."""
        ...

    def restore(self, state: Any) -> None:
        """Go back to a snapshot of a planner of this kind; what follows repeats exactly."""
        ...

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """Command for the next control period; without a waypoint, stand still."""
        ...
