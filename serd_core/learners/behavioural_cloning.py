"""Behavioural cloning: the smoothed empirical policy (section 3.1, Fig. 3.3a).

    pi(a | s) = (n(s, a) + c) / (n(s) + c |A(s)|)

In states never visited the policy is uniform.

    policy = clone_behaviour(problem, decisions, pseudo_count=0.5)
"""

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import Decisions, require_shown
from serd_core.demonstrations.observations import observe
from serd_core.errors import SerdError
from serd_core.mdp.problem import Problem


def clone_behaviour(
    problem: Problem, decisions: Decisions, pseudo_count: float = 1.0
) -> FloatArray:
    """(S, A) empirical policy with `pseudo_count` added to every available action."""
    if not (np.isfinite(pseudo_count) and pseudo_count > 0):
        raise SerdError(f"pseudo_count must be finite and above 0, got {pseudo_count}; use 1")
    require_shown(decisions, "cloning")
    counts = observe(problem.mdp, decisions).state_action
    smoothed = np.where(problem.mdp.available, counts + pseudo_count, 0.0)
    return np.asarray(smoothed / smoothed.sum(axis=1, keepdims=True))
