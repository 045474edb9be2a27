"""Arrival from every state at once: the absorbing chain of `arrival`, run backwards.

    F_0(s) = 1[s is a goal],  F_n(s) = sum_s' P_pi[s, s'] F_(n-1)(s'),  F_n(goal) = 1

F_n(s) is the probability of having arrived n decision periods after being in s. One table answers,
wherever the robot is and whenever it asks, how long the rest of its way will take; since the chain
has no memory, that is the law of the remaining time given all that has happened so far.

Index order: [n, s].
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.arrival.absorption import probability_of_ever_arriving
from serd_core.arrival.chain import ArrivalTimes, GoalProblem, policy_chain
from serd_core.errors import SerdError


@dataclass(frozen=True, eq=False)
class ArrivalByState:
    """cdf: (n_periods + 1, S) F_n(s); arrival_probability: (S,) of ever arriving."""

    cdf: FloatArray
    arrival_probability: FloatArray

    @property
    def n_periods(self) -> int:
        """The horizon in decision periods."""
        return len(self.cdf) - 1

    @cached_property
    def mean_periods(self) -> FloatArray:
        """(S,) mean of min(periods until arrival, horizon): sum over n < horizon of 1 - F_n."""
        return np.asarray((1.0 - self.cdf[:-1]).sum(axis=0))

    def from_state(self, state: int) -> ArrivalTimes:
        """The law of the remaining periods of a robot that is in `state` now."""
        if not 0 <= state < self.cdf.shape[1]:
            last = self.cdf.shape[1] - 1
            raise SerdError(f"state must be a state from 0 to {last}, got {state}; use the grid's")
        return ArrivalTimes(
            periods=np.arange(len(self.cdf)),
            cdf=self.cdf[:, state],
            arrival_probability=float(self.arrival_probability[state]),
        )

    def within(self, n_periods: int) -> FloatArray:
        """(S,) probability of arriving within so many periods; the horizon where it is beyond."""
        return np.asarray(self.cdf[min(max(n_periods, 0), self.n_periods)])


def arrival_by_state(
    problem: GoalProblem,
    policy: FloatArray,
    outcome_probabilities: FloatArray,
    n_periods: int,
) -> ArrivalByState:
    """Run the chain of an (S, A) policy backwards from its goals for `n_periods` periods."""
    if n_periods < 0:
        raise SerdError(f"n_periods must not be negative, got {n_periods}; use the time-out's")
    chain = policy_chain(problem.mdp, policy, outcome_probabilities)
    goal = np.zeros(problem.mdp.n_states, dtype=np.bool_)
    goal[problem.goal_states] = True
    cdf = np.empty((n_periods + 1, len(goal)))
    cdf[0] = goal
    for period in range(1, n_periods + 1):
        cdf[period] = np.where(goal, 1.0, chain @ cdf[period - 1])
    return ArrivalByState(np.minimum(cdf, 1.0), probability_of_ever_arriving(chain, goal))
