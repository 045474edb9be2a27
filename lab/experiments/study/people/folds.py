"""Folds of people: groups of runs, or blocks of time with gaps. No id is on both sides."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lab.experiments.study.people.recordings import Run
from lab.experiments.study.people.settings import FoldSettings
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.errors import SerdError

#: People that a fold learns from at least.
FEWEST = 10


@dataclass(frozen=True, eq=False)
class Fold:
    """(P,) masks of people: those learned from, and those held out."""

    training: BoolArray
    test: BoolArray


def folds_of(runs: Sequence[Run], settings: FoldSettings) -> tuple[Fold, ...]:
    """Folds over all walkers of all runs, in their order."""
    run = np.concatenate([np.full(len(each.walkers), i) for i, each in enumerate(runs)])
    spans = np.array(
        [(walker.time_s[0], walker.time_s[-1]) for each in runs for walker in each.walkers]
    )
    if len(runs) >= settings.runs:
        number = min(settings.number, len(runs))
        return tuple(Fold(run % number != k, run % number == k) for k in range(number))
    block = _blocks(runs, run, spans, settings.number)
    folds = tuple(_fold(run, spans, block, k, settings.gap_s) for k in range(settings.number))
    for k, fold in enumerate(folds):
        if not fold.test.any() or fold.training.sum() < FEWEST:
            raise SerdError(
                f"each of {settings.number} time blocks must hold people and leave {FEWEST} who are"
                f" not there with them to learn from, block {k + 1} has {fold.test.sum()} and"
                f" leaves {fold.training.sum()}; choose another number of folds (folds: number:),"
                f" or give {settings.runs} files"
            )
    return folds


def _blocks(runs: Sequence[Run], run: IntArray, spans: FloatArray, number: int) -> IntArray:
    """(P,) block of each person by the time of entry, blocks of a run being equally long."""
    begins = np.array([each.span_s[0] for each in runs])[run]
    ends = np.array([spans[run == i, 0].max() for i in range(len(runs))])[run]
    share = (spans[:, 0] - begins) / np.maximum(ends - begins, 1e-9)
    return np.asarray(np.clip((share * number).astype(np.int64), 0, number - 1))


def _fold(run: IntArray, spans: FloatArray, block: IntArray, k: int, gap_s: float) -> Fold:
    test = block == k
    near = np.zeros(len(run), dtype=np.bool_)
    for each in np.unique(run[test]):
        tested = spans[test & (run == each)]
        low, high = tested[:, 0].min() - gap_s, tested[:, 1].max() + gap_s
        near |= (run == each) & (spans[:, 1] >= low) & (spans[:, 0] <= high)
    return Fold(~near & ~test, test)
