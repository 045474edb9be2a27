"""The strategy: drives by a policy over the states of the grid."""

import numpy as np
from numpy.typing import ArrayLike

from serd_core.arrays import FloatArray, float_array
from serd_core.grid.grid import Action, Grid
from sim.errors import SimError
from sim.world.observation import Observation
from sim.world.seeds import POLICY, episode_rng


class PolicyDriver:
    """Chooses by `probabilities` (S, 5): the likeliest action, or one drawn when not greedy."""

    def __init__(
        self,
        grid: Grid,
        probabilities: ArrayLike,
        *,
        seed: int = 0,
        greedy: bool = True,
        name: str = "policy",
    ) -> None:
        self._grid, self._seed, self._greedy, self._name = grid, seed, greedy, name
        self._rng = episode_rng(seed, 0, POLICY)
        self.follow(probabilities)

    @property
    def name(self) -> str:
        """Name for tables."""
        return self._name

    def follow(self, probabilities: ArrayLike) -> None:
        """Drive by another policy on the same grid from now on, also within an episode."""
        table: FloatArray = float_array(
            "probabilities", probabilities, (self._grid.n_states, len(Action))
        )
        if (table < 0).any() or not np.allclose(table.sum(axis=1), 1):
            raise SimError(
                "probabilities must be at least 0 and sum to 1 in every state"
                "; pass Policy.probabilities of a problem on this grid"
            )
        self._probabilities = table

    def begin(self, episode: int) -> None:
        """Start the random numbers of this episode."""
        self._rng = episode_rng(self._seed, episode, POLICY)

    def decide(self, observation: Observation) -> Action:
        """The policy's action in the robot's cell; WAIT outside the grid."""
        state = self._grid.state_at(observation.x_m, observation.y_m)
        if state < 0:
            return Action.WAIT
        row = self._probabilities[state]
        if self._greedy:
            return Action(int(np.argmax(row)))
        return Action(int(self._rng.choice(len(row), p=row / row.sum())))
