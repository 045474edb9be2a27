"""Held-out log-likelihood of the decisions of a table, beside that of the uniform policy."""

from dataclasses import dataclass
from math import log
from pathlib import Path

import numpy as np

from serd_app.demonstrations.demonstrations import Demonstrations
from serd_app.learning.learning_files import read_learning_files
from serd_app.learning.recipe import learn, require_enough
from serd_app.learning.settings import LearningSettings
from serd_core.demonstrations.decisions import Decisions
from serd_core.selection.evaluation import validation_log_likelihood

_EVERY, _SHARE = 4, 0.25


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
    require_enough(files.demonstrations, settings)
    kept, left = _split(files.demonstrations.decisions)
    settings = settings.model_copy(update={"minimum_decisions": 1})
    fit = learn(files.task, Demonstrations(kept), settings).fit
    problem = files.task.problem
    return HeldOut(
        len(left),
        validation_log_likelihood(problem, left, fit),
        -log(problem.mdp.transitions.available.shape[1]),
    )


def _split(decisions: Decisions) -> tuple[Decisions, Decisions]:
    """Every fourth episode is held out; of fewer, the last quarter of all decisions."""
    episodes = decisions.episodes
    if len(episodes) >= _EVERY:
        out = np.isin(decisions.episode, episodes[_EVERY - 1 :: _EVERY])
    else:
        order = np.lexsort((decisions.time_s, decisions.episode))
        out = np.zeros(len(decisions), dtype=bool)
        out[order[len(order) - round(_SHARE * len(order)) :]] = True
    return decisions.select(~out), decisions.select(out)
