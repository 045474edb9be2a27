"""Behavioural cloning: the smoothed empirical policy (section 3.1, Fig. 3.3a).

    pi(a | s) = (n(s, a) + c) / (n(s) + c |A(s)|)

In states never visited the policy is uniform.
"""

import numpy as np

from serd_core.arrays import FloatArray, require_positive
from serd_core.demonstrations.decisions import Decisions, require_shown
from serd_core.demonstrations.observations import observe_in
from serd_core.mdp.problem import Problem


def clone_behaviour(
    problem: Problem, decisions: Decisions, pseudo_count: float = 1.0
) -> FloatArray:
    """Clone the demonstrated policy: (S, A) smoothed shares of the actions taken in each state.

    pseudo_count: c above 0, added to the count of every available action; states without decisions
    get a uniform policy. SerdError where actions are hidden.

        policy = sc.clone_behaviour(problem, decisions, pseudo_count=0.5)
    """
    require_positive("pseudo_count", pseudo_count)
    require_shown(decisions, "cloning")
    counts = observe_in(problem, decisions).state_action
    smoothed = np.where(problem.mdp.available, counts + pseudo_count, 0.0)
    return np.asarray(smoothed / smoothed.sum(axis=1, keepdims=True))
