"""Density of the people of a run at a time, per cell and for one walking direction.

Each person counts as a normal distribution on the floor, separately for those who walk the same
way and the opposite way. A walker's own share is included.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lab.experiments.study.people.recordings import Run
from serd_core.arrays import BoolArray, FloatArray, IntArray

#: Bins of a corridor of any size, along and across, for what runs of different sizes share.
BINS = (6, 5)


@dataclass(frozen=True, eq=False)
class Field:
    """(C,) per cell: people per m² who walk the same and the opposite way."""

    same_pm2: FloatArray
    opposite_pm2: FloatArray


def crowd_shares(places_m: FloatArray, people_m: FloatArray, kernel_m: float) -> FloatArray:
    """(C, N) density that each of the people (N, 2) adds at each place (C, 2).

    kernel_m: standard deviation h of exp(-distance^2 / 2 h^2) / (2 pi h^2).
    """
    away = places_m[:, None] - people_m[None, :]
    shares = np.exp(-np.sum(away**2, axis=2) / (2 * kernel_m**2)) / (2 * np.pi * kernel_m**2)
    return np.asarray(shares)


def field_at(run: Run, time_s: float, sign: int, kernel_m: float) -> Field:
    """The field at a time, seen by those of a direction."""
    there = [w for w in run.walkers if w.time_s[0] <= time_s <= w.time_s[-1]]
    if not there:
        zero = np.zeros(run.grid.n_states)
        return Field(zero, zero)
    turned = np.array([sign * walker.sign for walker in there])
    places = np.array([walker.at(time_s) for walker in there]) * turned[:, None]
    shares = crowd_shares(run.grid.centers_m, places, kernel_m)
    return Field(
        same_pm2=shares[:, turned > 0].sum(axis=1),
        opposite_pm2=shares[:, turned < 0].sum(axis=1),
    )


def bins_of(run: Run) -> IntArray:
    """(C,) which of the bins of a corridor of any size each cell is in."""
    rows, columns = run.grid.walkable.shape
    share = (run.grid.cells + 0.5) / (rows, columns)
    along = (share[:, 1] * BINS[0]).astype(np.int64)
    across = (share[:, 0] * BINS[1]).astype(np.int64)
    return np.asarray(along * BINS[1] + across)


def cells_of_bins(run: Run) -> BoolArray:
    """(B, C) mask of the cells in each bin; a bin that holds no centre has the cell of its own.

    So what is counted in a narrow corridor covers all bins that a wide one needs.
    """
    bins = np.arange(BINS[0] * BINS[1])
    found = bins[:, None] == bins_of(run)
    middle = np.stack([(bins % BINS[1] + 0.5) / BINS[1], (bins // BINS[1] + 0.5) / BINS[0]], axis=1)
    nearest = (middle * run.grid.walkable.shape).astype(np.int64)
    empty = ~found.any(axis=1)
    found[empty] = np.all(run.grid.cells == nearest[empty, None], axis=2)
    return np.asarray(found)


def mean_field(seen: Sequence[tuple[Run, Field]]) -> Field:
    """(B,) mean over fields, per bin."""
    inside = np.concatenate([cells_of_bins(run) for run, _ in seen], axis=1).astype(np.float64)

    def mean(name: str) -> FloatArray:
        values = np.concatenate([getattr(field, name) for _, field in seen])
        return np.asarray(inside @ values / inside.sum(axis=1))

    return Field(mean("same_pm2"), mean("opposite_pm2"))


def on_cells(run: Run, mean: Field) -> Field:
    """(C,) the mean of the bin of each cell."""
    place = bins_of(run)
    return Field(mean.same_pm2[place], mean.opposite_pm2[place])
