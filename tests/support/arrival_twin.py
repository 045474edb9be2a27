"""The arrival from every state by running the chain of a policy backwards, decision by decision.

It is the law F_n of docs/arrival.md without dwell times, computed apart from
`timed_arrival`.
"""

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.arrival.chain import (
    ArrivalByState,
    GoalProblem,
    goal_mask,
    policy_chain,
    probability_of_ever_arriving,
)


def arrival_by_state(
    problem: GoalProblem, policy: FloatArray, outcome_probabilities: FloatArray, n_steps: int
) -> ArrivalByState:
    """The arrival within 0, 1, ... n_steps decisions."""
    goal = goal_mask(problem)
    chain = policy_chain(problem.mdp, policy, outcome_probabilities)
    cdf = np.empty((n_steps + 1, len(goal)))
    cdf[0] = goal
    for step in range(1, n_steps + 1):
        cdf[step] = np.where(goal, 1.0, chain @ cdf[step - 1])
    return ArrivalByState(np.minimum(cdf, 1.0), probability_of_ever_arriving(chain, goal))
