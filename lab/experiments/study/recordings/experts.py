"""Experts of the study: scripted people, and planners with a known reward and belief.

A planner follows a soft policy (3.28 to 3.30). Its belief about the crowd is known, so the study
can compare assumptions about the belief: it plans with the reference dynamics ("knows"), or with
dynamics that are wrong about the crowd ("ignores_crowd", "fears_crowd").
"""

from collections.abc import Callable

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.grid.grid import Outcome
from serd_core.grid.navigation import ACROSS_FLOW, AGAINST_FLOW, WITH_FLOW, NavigationProblem
from serd_core.policies.solved_policy import soft_policy

#: Believed probability of standing still in moves against and across the flow, of "fears_crowd".
_FEARED_STANDING = {AGAINST_FLOW: 0.95, ACROSS_FLOW: 0.65}


def _ignores_crowd(truth: FloatArray) -> FloatArray:
    """Every move goes as easily as one with the flow."""
    belief = truth.copy()
    belief[[AGAINST_FLOW, ACROSS_FLOW]] = truth[WITH_FLOW]
    return belief


def _fears_crowd(truth: FloatArray) -> FloatArray:
    """Moves against the flow and across it nearly always fail."""
    belief = truth.copy()
    for model, standing in _FEARED_STANDING.items():
        belief[model, Outcome.STAY] = 0.0
        belief[model] *= (1.0 - standing) / belief[model].sum()
        belief[model, Outcome.STAY] = standing
    return belief


#: Belief (M, K) of each planned expert, as a function of the true dynamics.
BELIEFS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "knows": lambda truth: truth,
    "ignores_crowd": _ignores_crowd,
    "fears_crowd": _fears_crowd,
}
PEOPLE = "people"
EXPERTS = (PEOPLE, *BELIEFS)


def planned_policy(
    problem: NavigationProblem, name: str, reward_weights: tuple[float, ...], truth: FloatArray
) -> FloatArray:
    """(S, A) policy of the expert of that name."""
    belief = BELIEFS[name](truth)
    return soft_policy(problem, np.array(reward_weights), belief).probabilities
