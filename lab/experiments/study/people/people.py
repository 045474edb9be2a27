"""The people of a study: their moves, the forecasts asked for, and the crowd around each."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from lab.experiments.study.people.cross_validation.forecasts import Asked, asked_of, horizon_of
from lab.experiments.study.people.crowd import Field, field_at, on_cells
from lab.experiments.study.people.problem import Layer, Moves, moves_of
from lab.experiments.study.people.recordings import Run, Walker, read_runs
from lab.experiments.study.people.settings import PeopleSettings
from serd_core.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class People:
    """P walkers of all runs, numbered run by run."""

    runs: tuple[Run, ...]
    settings: PeopleSettings

    @classmethod
    def read(cls, settings: PeopleSettings) -> "People":
        """The people of the files that the settings name."""
        paths = [Path(each) for each in settings.files]
        return cls(read_runs(paths, settings.columns, settings.grid), settings)

    @cached_property
    def moves(self) -> tuple[Moves, IntArray, IntArray]:
        """Moves, with (N,) run and (N,) sign of each; see `moves_of`."""
        return moves_of(self.runs)

    @cached_property
    def _layers(self) -> dict[tuple[int, int, int], Layer]:
        return {}

    def _layer(self, run: int, sign: int, snapshot: int) -> Layer:
        """The crowd of a snapshot; each is computed once."""
        key, crowd = (run, sign, snapshot), self.settings.crowd
        if key not in self._layers:
            time_s = snapshot * crowd.snapshot_s
            field = field_at(self.runs[run], time_s, sign, crowd.kernel_m)
            self._layers[key] = Layer(self.runs[run], sign, snapshot, field)
        return self._layers[key]

    @cached_property
    def walkers(self) -> tuple[Walker, ...]:
        """(P,) all of them."""
        return tuple(walker for run in self.runs for walker in run.walkers)

    @cached_property
    def run_of(self) -> IntArray:
        """(P,) run of each person."""
        return np.repeat(np.arange(len(self.runs)), [len(run.walkers) for run in self.runs])

    @cached_property
    def asked(self) -> tuple[Asked, ...]:
        """(P,) the forecast of each person."""
        cells = self.settings.grid.observed_cells
        return tuple(
            asked_of(walker, i, self.runs[self.run_of[i]], cells)
            for i, walker in enumerate(self.walkers)
        )

    @cached_property
    def horizon_s(self) -> float:
        """Seconds that forecasts cover."""
        return horizon_of(self.asked, self.settings.forecast)

    def layers_at(self, run: IntArray, sign: IntArray, time_s: FloatArray) -> "LayersAt":
        """The layers of these times, by snapshot, and (N,) which one each is in."""
        snapshot = np.floor(time_s / self.settings.crowd.snapshot_s).astype(np.int64)
        keys, place = np.unique(
            np.stack([run, sign, snapshot], axis=1), axis=0, return_inverse=True
        )
        layers = tuple(self._layer(*key) for key in keys.tolist())
        return LayersAt(layers, place.reshape(-1))

    def asked_of(self, mask: BoolArray) -> list[Asked]:
        """The forecasts of the people of a mask (P,)."""
        return [self.asked[i] for i in np.flatnonzero(mask)]

    def side_of(self, mask: BoolArray) -> "Side":
        """The moves of the people of a mask (P,)."""
        moves, run, sign = self.moves
        rows = mask[moves.walker]
        moves, run, sign = moves.select(rows), run[rows], sign[rows]
        dense = self.layers_at(run, sign, moves.entered_s)
        return Side(moves, dense, 2 * run + (sign > 0))

    def crowds_of(self, asked: Sequence[Asked]) -> "LayersAt":
        """The crowd at the time of each forecast."""
        run = self.run_of[[one.walker for one in asked]]
        sign = np.array([self.walkers[one.walker].sign for one in asked])
        return self.layers_at(run, sign, np.array([one.time_s for one in asked]))

    def mean_layer_of(self, asked: Sequence[Asked]) -> IntArray:
        """(N,) which of `mean_layers` each person is in."""
        people = [one.walker for one in asked]
        ahead = [self.walkers[person].sign > 0 for person in people]
        return np.asarray(2 * self.run_of[people] + ahead)

    def mean_layers(self, mean: Field) -> tuple[Layer, ...]:
        """One layer per run and direction, (run 0, -1), (run 0, 1), (run 1, -1), ..."""
        return tuple(
            Layer(run, sign, -1, on_cells(run, mean)) for run in self.runs for sign in (-1, 1)
        )


@dataclass(frozen=True, eq=False)
class LayersAt:
    """layers, and (N,) which of them each time is in."""

    layers: tuple[Layer, ...]
    place: IntArray


@dataclass(frozen=True, eq=False)
class Side:
    """Moves of a side of a fold, on layers with the crowd of each time and on those of the mean."""

    moves: Moves
    dense: LayersAt
    mean: IntArray


def evenly(mask: BoolArray, most: int) -> BoolArray:
    """A mask of at most so many of the people of a mask."""
    people = np.flatnonzero(mask)
    chosen = np.linspace(0, len(people) - 1, min(most, len(people))).round().astype(np.int64)
    found = np.zeros_like(mask)
    found[people[chosen]] = True
    return found


def subset_of(dense: LayersAt, most: int) -> LayersAt:
    """Evenly chosen layers; place is -1 for what is in none of them."""
    number = len(dense.layers)
    if number <= most:
        return dense
    chosen = np.unique(np.linspace(0, number - 1, most).round().astype(np.int64))
    place = np.full(number, -1)
    place[chosen] = np.arange(len(chosen))
    return LayersAt(tuple(dense.layers[i] for i in chosen), place[dense.place])
