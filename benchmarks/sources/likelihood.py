"""Held-out log-likelihood of the decisions of a table, beside that of the uniform policy."""

from dataclasses import dataclass
from math import log
from pathlib import Path

import numpy as np

from serd_app.demonstrations.demonstrations import Demonstrations
from serd_app.learning.learning_files import read_learning_files
from serd_app.learning.recipe import learn, require_enough
from serd_app.learning.settings import LearningSettings
from serd_core.arrays import IntArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.selection.evaluation import validation_log_likelihood

_FOLDS = 4
#: With more decisions than these, one fold is held out instead of each in turn.
_FEW = 200


@dataclass(frozen=True)
class HeldOut:
    """Per decision: log-likelihood of n decisions that were not learned from, and log(1/5)."""

    n: int
    learned: float
    uniform: float


def held_out(table: Path) -> HeldOut:
    """Learn from the other decisions as 'serd learn' does; SerdError where all are too few."""
    settings = LearningSettings()
    files = read_learning_files(table, discount=settings.discount)
    decisions, problem = files.demonstrations.decisions, files.task.problem
    require_enough(files.demonstrations, settings)
    settings = settings.model_copy(update={"minimum_decisions": 1})
    fold = _folds(decisions)
    total, n = 0.0, 0
    for each in range(_FOLDS if len(decisions) < _FEW else 1):
        kept, left = (decisions.select(rows) for rows in (fold != each, fold == each))
        fit = learn(files.task, Demonstrations(kept), settings).fit
        total += len(left) * validation_log_likelihood(problem, left, fit)
        n += len(left)
    return HeldOut(n, total / n, -log(problem.mdp.transitions.available.shape[1]))


def _folds(decisions: Decisions) -> IntArray:
    """(N,) every fourth episode is of one fold; of fewer episodes, a quarter of the time."""
    number = np.searchsorted(decisions.episodes, decisions.episode)
    if len(decisions.episodes) >= _FOLDS:
        return np.asarray(number % _FOLDS)
    order = np.lexsort((decisions.time_s, decisions.episode))
    fold = np.empty(len(decisions), dtype=np.int64)
    fold[order] = np.arange(len(decisions)) * _FOLDS // len(decisions)
    return fold
