"""Drivers by a policy over the states of the grid, for instance that of a learned model."""

import math

import numpy as np
from numpy.typing import ArrayLike

from serd_core.arrays import FloatArray
from serd_core.checks import float_array
from serd_core.grid.grid import DIRECTION_VECTORS, Action, Grid
from serd_sim.drivers.strategy import load_strategy
from serd_sim.errors import SimError
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import POLICY, Observation, episode_rng

#: Probabilities that differ less are equal.
_EQUAL = 1e-9
#: Angle (rad) by which a robot that turns slowly has turned since it decided, and its least rate.
_TURNED_RAD, _TURNING_RADPS = 0.3, 0.05


class PolicyDriver:
    """Chooses by `probabilities` (S, 5): a likeliest action, or one drawn when not greedy.

    Of equally likely actions one is drawn. A greedy robot that has just come in one of their
    directions turns to the side, where that is one of them, or goes on: such a way in steps is near
    the straight one, and the robot cuts its corners. A greedy robot that is still in the cell where
    it decided to move was blocked, unless it is still turning towards where it is to go. Until it
    is two cells away from where it was blocked, what it has done in a cell is left out there, until
    nothing is left: so cells that block each other do not hold it.
    """

    def __init__(
        self,
        grid: Grid,
        probabilities: ArrayLike,
        *,
        seed: int = 0,
        greedy: bool = True,
        name: str = "policy",
    ) -> None:
        self._grid, self._seed, self._greedy, self.name = grid, seed, greedy, name
        self._probabilities = np.zeros((grid.n_states, len(Action)))
        self.begin(0)
        self.follow(probabilities)

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
        if not np.array_equal(table, self._probabilities):
            self._clear()  # what another policy did was not blocked
        self._probabilities = table

    def begin(self, episode: int) -> None:
        """Start the random numbers of this episode."""
        self._clear()
        self._last, self._away_rad = Action.WAIT, 0.0
        self._rng = episode_rng(self._seed, episode, POLICY)

    def decide(self, observation: Observation, state: int) -> Action:
        """The policy's action in a cell; WAIT outside the grid."""
        if state < 0:
            return Action.WAIT
        if state != self._state or not self._turns(observation):
            self._choose(state)
        self._away_rad = abs(self._away(observation))
        return self._last

    def _turns(self, observation: Observation) -> bool:
        """Whether the robot has turned towards where it decided to go last, and turns on."""
        away_rad, rate_radps = self._away(observation), observation.yaw_rate_radps
        goes_on = away_rad * rate_radps > 0 and abs(rate_radps) >= _TURNING_RADPS
        return goes_on and self._away_rad - abs(away_rad) >= _TURNED_RAD

    def _away(self, observation: Observation) -> float:
        """Angle (rad) from the heading of the robot to the last action; 0 for one to wait."""
        if self._last == Action.WAIT:
            return 0.0
        east, north = DIRECTION_VECTORS[self._last]
        return math.remainder(math.atan2(north, east) - observation.yaw_rad, math.tau)

    def _choose(self, state: int) -> None:
        tried = self._tried_in(state)
        row = self._probabilities[state]
        if self._greedy:
            row = self._turned(self._likeliest(state, tried))
        action = self._last = Action(int(self._rng.choice(len(row), p=row / row.sum())))
        if tried or action != Action.WAIT:
            tried.add(action)

    def _clear(self) -> None:
        self._state, self._tried, self._blocked_in = -1, dict[int, set[Action]](), set[int]()

    def _tried_in(self, state: int) -> set[Action]:
        """What a blocked robot has done in a cell; empty for one that was not blocked."""
        if state == self._state and self._tried[state]:
            self._blocked_in.add(state)
        elif state != self._state and not self._is_near_blocked(state):
            self._clear()
        self._state = state
        return self._tried.setdefault(state, set())

    def _is_near_blocked(self, state: int) -> bool:
        """Whether the robot was blocked in this cell or in one beside it."""
        cells = self._grid.cells
        away = np.abs(cells[list(self._blocked_in)] - cells[state]).sum(axis=1)
        return bool((away < 2).any())

    def _likeliest(self, state: int, tried: set[Action]) -> FloatArray:
        """(5,) 1 for each of the likeliest actions that are left."""
        row = self._left(state, tried) if tried else self._probabilities[state]
        if not row.any():
            tried.clear()
            row = self._probabilities[state]
        return np.asarray(row >= row.max() - _EQUAL, dtype=np.float64)

    def _turned(self, likeliest: FloatArray) -> FloatArray:
        """(5,) of the likeliest actions those to the side of the last direction, or this one."""
        last = self._last
        if last == Action.WAIT or not likeliest[last]:
            return likeliest
        to_side = np.where(DIRECTION_VECTORS @ DIRECTION_VECTORS[last] == 0, likeliest, 0.0)
        to_side[Action.WAIT] = 0.0
        return to_side if to_side.any() else np.eye(len(likeliest))[last]

    def _left(self, state: int, tried: set[Action]) -> FloatArray:
        """(5,) the policy's weights of what a blocked robot has not tried, 0 towards walls.

        Where the policy has no other action, all other ways out of the cell are as likely.
        """
        ways = self._grid.neighbours[state] != state
        row = np.where(ways, self._probabilities[state], 0.0)
        row[Action.WAIT] = self._probabilities[state, Action.WAIT]
        row[list(tried)] = 0.0
        if not row.any():
            row[:] = ways
            row[list(tried)] = 0.0
        return row


def model_driver(path: str, scenario: Scenario, seed: int) -> PolicyDriver:
    """Drives by the optimal policy of a model, and where it is trapped by the way of least time.

    FileError where the model is for another grid.
    """
    policy = load_strategy(path, scenario, "optimal").policy
    return PolicyDriver(grid_of(scenario), policy.probabilities, seed=seed, name=path)
