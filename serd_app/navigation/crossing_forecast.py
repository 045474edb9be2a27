"""When a robot arrives whose crossings of cells take random times (docs/arrival.md).

The way is that of the model: which cell is entered next, given that one is left. The times are
those of recorded drives with the same look-ahead. Decision periods, by which a robot moves one cell
at most, are not used.
"""

from dataclasses import dataclass
from functools import cached_property
from math import ceil

import numpy as np

from serd_app.demonstrations.crossing_table import people_per_m2
from serd_app.learning.crossing_times import dwell_model, mean_and_kind, pace_of_a_drive
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.chain import ArrivalByState
from serd_core.arrival.crossing_chain import (
    N_CLASSES,
    N_DIRECTIONS,
    CrossingMoves,
    Kind,
    cdf_after_first_moves,
    crossing_chain,
)
from serd_core.arrival.dwell_times import paced_law
from serd_core.arrival.law import ArrivalLaw
from serd_core.arrival.semi_markov import DwellTimes, semi_markov_arrival
from serd_core.grid.grid import Action
from serd_core.grid.navigation import MODEL_NAMES, WAITING, NavigationProblem
from storage.model_file import CrossingTimes

STEP_S = 0.2
#: Share of the first cell from the start to its border, on average over starts all over the cell.
_WAY_OF_START = 0.5
_TAIL = 1e-9


@dataclass(frozen=True, eq=False)
class CrossingForecast:
    """moves: the way; n_people: in the world; horizon_s: until which arrivals are predicted."""

    problem: NavigationProblem
    moves: CrossingMoves
    times: CrossingTimes
    n_people: int
    horizon_s: float

    @property
    def extrapolates(self) -> bool:
        """Whether the drives were among fewer or more people."""
        low, high = self.times.people_pm2
        return not low - _TAIL <= self._people_pm2 <= high + _TAIL

    @cached_property
    def arrival(self) -> ArrivalByState:
        """In steps of `STEP_S` from each (cell, direction of entry), at the pace of the mean."""
        chain = crossing_chain(self.moves)
        rows = [
            self._mass(number // 2, Kind.TURNING if number % 2 else Kind.STRAIGHT)
            for number in range(N_CLASSES)
        ]
        return semi_markov_arrival(chain, DwellTimes(STEP_S, _stacked(rows)), self._n_steps)

    def by_cell(self, greedy: IntArray) -> ArrivalByState:
        """(N + 1, S) from each cell, entered in the direction in which the policy goes on."""
        entered = np.where(greedy == Action.WAIT, int(Action.NORTH), greedy)
        state = N_DIRECTIONS * np.arange(len(greedy)) + entered - 1
        return ArrivalByState(self.arrival.cdf[:, state], self.arrival.arrival_probability[state])

    def from_start(self, share: FloatArray) -> ArrivalLaw:
        """Of an episode that begins in cells of the probabilities (S,)."""
        rows = [self._mass(model, Kind.FIRST) for model in range(WAITING)]
        return self._law(share, _stacked(rows), self.moves.model)

    def from_pose(self, state: int, entered: Action, x_m: float, y_m: float) -> ArrivalLaw:
        """Of a robot on its way, at a point of a cell.

        entered: the direction in which it came in, WAIT in the first cell of an episode. The time
        until it leaves the cell is in proportion to the way that is left in it, and times in first
        cells are those of `_WAY_OF_START`.
        """
        moves, rows = self.moves, []
        here = np.flatnonzero(moves.state == state)
        own_class = np.full(len(moves.state), -1)
        for number, move in enumerate(here.tolist()):
            direction, model = int(moves.direction[move]), int(moves.model[move])
            kind = Kind.STRAIGHT if direction == entered else Kind.TURNING
            left = self._way_left(state, direction, x_m, y_m)
            if entered == Action.WAIT:
                kind, left = Kind.FIRST, left / _WAY_OF_START
            rows.append(self._mass(model, kind, left))
            own_class[move] = number
        share = np.zeros(len(moves.goal))
        share[state] = 1.0
        return self._law(share, _stacked(rows), own_class)

    def _law(self, share: FloatArray, first: FloatArray, first_class: IntArray) -> ArrivalLaw:
        cdf = cdf_after_first_moves(self.moves, share, first, first_class, self.arrival)
        onward = N_DIRECTIONS * self.moves.successor + self.moves.direction - 1
        weight = share[self.moves.state] * self.moves.probability
        ever = float(
            weight @ self.arrival.arrival_probability[onward] + share[self.moves.goal].sum()
        )
        times_s = np.asarray(STEP_S * np.arange(self._n_steps + 1), dtype=np.float64)
        law = ArrivalLaw(times_s, cdf, ever)
        return paced_law(law, pace_of_a_drive(self.times))

    def _mass(self, model: int, kind: Kind, share: float = 1.0) -> FloatArray:
        """(J,) of a class of moves, without the tail; share: of their mean."""
        mean_s, place = mean_and_kind(self.times, MODEL_NAMES[model], kind, self._people_pm2)
        law = dwell_model(self.times).mass(share * mean_s, place, STEP_S, self._n_steps)[0]
        return np.asarray(law[: int(np.searchsorted(np.cumsum(law), 1.0 - _TAIL)) + 1])

    def _way_left(self, state: int, direction: int, x_m: float, y_m: float) -> float:
        """Share of a cell from a point of it to its border in a direction, above 0."""
        grid = self.problem.grid
        east, north = (np.array([x_m, y_m]) - grid.centers_m[state]) / grid.cell_size_m
        ahead = {Action.NORTH: north, Action.EAST: east, Action.SOUTH: -north, Action.WEST: -east}
        return float(np.clip(0.5 - ahead[Action(direction)], 0.05, 1.0))

    @property
    def _people_pm2(self) -> float:
        return people_per_m2(self.problem.grid, self.n_people)

    @property
    def _n_steps(self) -> int:
        return ceil(self.horizon_s / STEP_S - _TAIL)


def _stacked(rows: list[FloatArray]) -> FloatArray:
    """(C, J) rows of unequal length, with zeros behind."""
    table = np.zeros((len(rows), max((len(row) for row in rows), default=1)))
    for place, row in zip(table, rows, strict=True):
        place[: len(row)] = row
    return table
