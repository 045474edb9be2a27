"""A robot that explores: keeps a random direction for a while, so that it moves every way."""

import numpy as np

from serd_core.grid.grid import Action, Grid
from sim.world.observation import Observation
from sim.world.seeds import POLICY, episode_rng

_CHANGES_MIND, _WAITS = 0.35, 0.1


class ExploringDriver:
    """Seeded; draws a new direction now and then, and always one that no wall blocks."""

    def __init__(self, grid: Grid, seed: int) -> None:
        self._grid, self._seed = grid, seed
        self.begin(0)

    @property
    def name(self) -> str:
        """Name for tables."""
        return "exploring"

    def begin(self, episode: int) -> None:
        """Start the random numbers of this episode."""
        self._rng = episode_rng(self._seed, episode, POLICY)
        self._action = Action.WAIT

    def decide(self, observation: Observation) -> Action:
        """The direction it has, or a new one."""
        state = self._grid.state_at(observation.x_m, observation.y_m)
        neighbours = self._grid.neighbours[state]
        if self._rng.random() < _CHANGES_MIND or neighbours[self._action] == state:
            waits = self._rng.random() < _WAITS
            free = np.flatnonzero(neighbours != state)
            self._action = Action.WAIT if waits else Action(int(self._rng.choice(free)))
        return self._action
