"""The people of a study: their moves, the forecasts asked for, and the mean crowd around them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from lab.experiments.study.people.crowd import Field, field_at, mean_field, on_cells
from lab.experiments.study.people.forecasts import Asked, asked_of, horizon_of
from lab.experiments.study.people.problem import Layer, Moves, layer_of, moves_of
from lab.experiments.study.people.recordings import Run, Walker, read_runs
from lab.experiments.study.people.settings import PeopleSettings
from serd_core.arrays import BoolArray, IntArray


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
    def moves(self) -> Moves:
        """All moves; see `moves_of`."""
        return moves_of(self.runs)

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

    def asked_of(self, mask: BoolArray) -> list[Asked]:
        """The forecasts of the people of a mask (P,)."""
        return [self.asked[i] for i in np.flatnonzero(mask)]

    def moves_of(self, mask: BoolArray) -> Moves:
        """The moves of the people of a mask (P,)."""
        return self.moves.select(mask[self.moves.walker])

    def layer_of(self, asked: Sequence[Asked]) -> IntArray:
        """(N,) which of `layers` each person is in."""
        return np.array(
            [layer_of(self.run_of[one.walker], self.walkers[one.walker]) for one in asked]
        )

    def mean_crowd(self, moves: Moves) -> Field:
        """(B,) mean crowd at the times of moves, of at most `snapshots` snapshots evenly chosen."""
        crowd = self.settings.crowd
        snapshot = np.floor(moves.entered_s / crowd.snapshot_s).astype(np.int64)
        keys = np.unique(np.stack([moves.layer, snapshot], axis=1), axis=0)
        if len(keys) > crowd.snapshots:
            places = np.linspace(0, len(keys) - 1, crowd.snapshots).round().astype(np.int64)
            keys = keys[np.unique(places)]
        seen = []
        for layer, number in keys.tolist():
            run, sign = self.runs[layer // 2], 1 if layer % 2 else -1
            seen.append((run, field_at(run, number * crowd.snapshot_s, sign, crowd.kernel_m)))
        return mean_field(seen)

    def layers(self, mean: Field) -> tuple[Layer, ...]:
        """One layer per run and direction, in the order of `layer_of`."""
        return tuple(Layer(run, on_cells(run, mean)) for run in self.runs for _ in (-1, 1))


def evenly(mask: BoolArray, most: int) -> BoolArray:
    """A mask of at most so many of the people of a mask."""
    people = np.flatnonzero(mask)
    chosen = np.linspace(0, len(people) - 1, min(most, len(people))).round().astype(np.int64)
    found = np.zeros_like(mask)
    found[people[chosen]] = True
    return found
