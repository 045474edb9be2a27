"""When a robot arrives whose crossings of cells take random times (docs/arrival.md).

The way is that of the model: which cell is entered next, given that one is left. The times are
those of recorded drives with the same look-ahead. Decision periods, by which a robot moves one cell
at most, are not used.

Forecasts on the way are made at the mean of the posterior's draws of outcomes; that of an episode
is the average over the draws, each with a mean pace of its own.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from serd_app.demonstrations.crossing_table import people_per_m2
from serd_app.learning.crossing_times import (
    dwell_model,
    mean_and_kind,
    pace_of_a_drive,
    paces_of_draws,
)
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
from serd_core.arrival.dwell_times import Pace, paced_law
from serd_core.arrival.law import ArrivalLaw, steps_within
from serd_core.arrival.semi_markov import DwellTimes, semi_markov_arrival
from serd_core.grid.grid import Action
from serd_core.grid.navigation import MODEL_NAMES, WAITING, NavigationProblem
from serd_files.model_file import CrossingTimes

STEP_S = 0.2
#: Share of the first cell from the start to its border, on average over starts all over the cell.
_WAY_OF_START = 0.5
_TAIL = 1e-9
#: Draws are followed twice as long as the mean takes until at most this share arrives later.
_LATE = 1e-6
#: Fewest mean paces of which the spread of the law of an episode consists.
_FEWEST_PACES = 20


@dataclass(frozen=True, eq=False)
class CrossingForecast:
    """moves: the way, draws: those of the posterior, at least one.

    n_people: in the world; horizon_s: until which arrivals are predicted.
    """

    problem: NavigationProblem
    moves: CrossingMoves
    draws: tuple[CrossingMoves, ...]
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
        return semi_markov_arrival(crossing_chain(self.moves), self._dwell, self._n_steps)

    @cached_property
    def _dwell(self) -> DwellTimes:
        """Of each class of moves."""
        rows = [
            self._mass(number // 2, Kind.TURNING if number % 2 else Kind.STRAIGHT)
            for number in range(N_CLASSES)
        ]
        return DwellTimes(STEP_S, _stacked(rows))

    @cached_property
    def _arrival_of_draws(self) -> tuple[ArrivalByState, ...]:
        """As `arrival`, until nearly all that arrive have arrived."""
        if len(self.draws) == 1:
            return (self.arrival,)
        late = np.flatnonzero((self.arrival.cdf[-1] - self.arrival.cdf > _LATE).any(axis=1))
        n_steps = min(2 * (int(late.max(initial=0)) + 1), self._n_steps)
        return tuple(
            semi_markov_arrival(crossing_chain(moves), self._dwell, n_steps) for moves in self.draws
        )

    def by_cell(self, greedy: IntArray) -> ArrivalByState:
        """(N + 1, S) from each cell, entered in the direction in which the policy goes on."""
        entered = np.where(greedy == Action.WAIT, int(Action.NORTH), greedy)
        state = N_DIRECTIONS * np.arange(len(greedy)) + entered - 1
        return ArrivalByState(self.arrival.cdf[:, state], self.arrival.arrival_probability[state])

    def from_start(self, share: FloatArray) -> ArrivalLaw:
        """Of an episode that begins in cells of the probabilities (S,), by each draw."""
        first = _stacked([self._mass(model, Kind.FIRST) for model in range(WAITING)])
        arrivals, n_draws = self._arrival_of_draws, len(self.draws)
        paces = paces_of_draws(self.times, max(n_draws, _FEWEST_PACES))
        laws = [
            self._law(
                self.draws[number % n_draws],
                arrivals[number % n_draws],
                share,
                first,
                self.draws[number % n_draws].model,
                pace,
            )
            for number, pace in enumerate(paces)
        ]
        cdf_draws = np.stack([law.cdf for law in laws])
        ever = float(np.mean([law.arrival_probability for law in laws]))
        return replace(
            laws[0], cdf=cdf_draws.mean(axis=0), arrival_probability=ever, cdf_draws=cdf_draws
        )

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
        pace = pace_of_a_drive(self.times)
        return self._law(moves, self.arrival, share, _stacked(rows), own_class, pace)

    def _law(
        self,
        moves: CrossingMoves,
        arrival: ArrivalByState,
        share: FloatArray,
        first: FloatArray,
        first_class: IntArray,
        pace: Pace,
    ) -> ArrivalLaw:
        """arrival: from the states of the moves, up to the horizon or until all have arrived."""
        cdf = cdf_after_first_moves(moves, share, first, first_class, arrival)
        cdf = np.pad(cdf, (0, self._n_steps + 1 - len(cdf)), mode="edge")
        onward = N_DIRECTIONS * moves.successor + moves.direction - 1
        weight = share[moves.state] * moves.probability
        ever = float(weight @ arrival.arrival_probability[onward] + share[moves.goal].sum())
        times_s = np.asarray(STEP_S * np.arange(self._n_steps + 1), dtype=np.float64)
        return paced_law(ArrivalLaw(times_s, cdf, ever), pace)

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
        return steps_within(self.horizon_s, STEP_S)


def _stacked(rows: list[FloatArray]) -> FloatArray:
    """(C, J) rows of unequal length, with zeros behind."""
    table = np.zeros((len(rows), max((len(row) for row in rows), default=1)))
    for place, row in zip(table, rows, strict=True):
        place[: len(row)] = row
    return table
