"""Held-out log-likelihood of the decisions of a table, beside that of the uniform policy.

Where actions are hidden it is that of the states, and uniform are policy and outcomes.
"""

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
from serd_core.grid.navigation import NavigationProblem
from serd_core.selection.evaluation import move_log_likelihood, validation_log_likelihood

_FOLDS = 4
#: With more decisions than these, one fold is held out instead of each in turn.
_FEW = 200


@dataclass(frozen=True)
class HeldOut:
    """Per decision: log-likelihood of n decisions that were not learned from, and by chance."""

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
    total, by_chance, n = 0.0, 0.0, 0
    for each in range(_FOLDS if len(decisions) < _FEW else 1):
        kept, left = (decisions.select(rows) for rows in (fold != each, fold == each))
        fit = learn(files.task, Demonstrations(kept), settings).fit
        total += len(left) * validation_log_likelihood(problem, left, fit)
        by_chance += uniform_log_likelihood(problem, left)
        n += len(left)
    return HeldOut(n, total / n, by_chance / n)


def uniform_log_likelihood(problem: NavigationProblem, decisions: Decisions) -> float:
    """Sum of log(1/5), and where the action is hidden of the states if all is likely alike."""
    mdp, models = problem.mdp, problem.outcome_models
    hidden = decisions.select(decisions.hidden)
    policy = mdp.available / mdp.available.sum(axis=1, keepdims=True)
    table = np.full((models.n_models, models.n_outcomes), 1.0 / models.n_outcomes)
    moves = move_log_likelihood(problem, hidden, policy, table).sum() if len(hidden) else 0.0
    return float(moves) - (len(decisions) - len(hidden)) * log(mdp.n_actions)


def _folds(decisions: Decisions) -> IntArray:
    """(N,) every fourth episode is of one fold; of fewer episodes, a quarter of the time."""
    number = np.searchsorted(decisions.episodes, decisions.episode)
    if len(decisions.episodes) >= _FOLDS:
        return np.asarray(number % _FOLDS)
    order = np.lexsort((decisions.time_s, decisions.episode))
    fold = np.empty(len(decisions), dtype=np.int64)
    fold[order] = np.arange(len(decisions)) * _FOLDS // len(decisions)
    return fold
