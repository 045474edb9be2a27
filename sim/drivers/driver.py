"""What every driver is: whoever decides, once per decision period, where the robot goes next."""

from typing import Protocol

from serd_core.grid.grid import Action
from sim.world.observation import Observation


class Driver(Protocol):
    """A person's stand-in or a learned policy."""

    @property
    def name(self) -> str:
        """Name for tables."""
        ...

    def begin(self, episode: int) -> None:
        """A new episode starts; random choices depend on its number only."""
        ...

    def decide(self, observation: Observation) -> Action:
        """The action of the decision period that begins now."""
        ...
