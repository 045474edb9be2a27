"""Time of arrival predicted by the absorbing chain of a policy (Fig. 5.10).

The chain P_pi[s, s'] = sum_a pi(a|s) P(s'|s,a) moves the start distribution one decision at a
time; what has reached a goal state has arrived. Goals absorb under every policy.

Run backwards it gives the arrival from every state at once, index order [n, s]:

    F_0(s) = 1[s is a goal],  F_n(s) = sum_s' P_pi[s, s'] F_(n-1)(s'),  F_n(goal) = 1

F_n(s) is the probability of having arrived n decisions after being in s. Since the chain has no
memory, that is the law of the remaining time given all that has happened so far.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.sparse

from serd_core.arrays import BoolArray, FloatArray, IntArray, chosen_indices, require_count
from serd_core.arrival.absorption import probability_of_ever_arriving
from serd_core.dynamics.transition_model import transitions_of
from serd_core.mdp.mdp import Mdp, checked_distribution, checked_policy
from serd_core.mdp.problem import require_problem


class GoalProblem(Protocol):
    """An MDP with goal states, such as `NavigationProblem`."""

    @property
    def mdp(self) -> Mdp:
        """The MDP."""

    @property
    def goal_states(self) -> IntArray:
        """Indices of the states that count as arrived."""


@dataclass(frozen=True, eq=False)
class ArrivalTimes:
    """Predicted arrival.

    decisions: (n_decisions + 1,) 0, 1, ...; cdf: probability of having arrived after each.
    arrival_probability: probability of ever arriving.
    """

    decisions: IntArray
    cdf: FloatArray
    arrival_probability: float


def arrival_time_distribution(
    problem: GoalProblem,
    policy: FloatArray,
    outcome_probabilities: FloatArray | None,
    start_distribution: FloatArray,
    n_decisions: int,
) -> ArrivalTimes:
    """Distribution of the number of decisions until a goal state is reached.

    policy: (S, A) probabilities; outcome_probabilities: None for transitions without parameters;
    start_distribution: (S,) probabilities.
    """
    goal = goal_mask(problem)
    chain = policy_chain(problem.mdp, policy, outcome_probabilities)
    share = checked_distribution("start_distribution", start_distribution, problem.mdp.n_states)
    require_count("n_decisions", n_decisions, 0, "the time-out's")
    cdf = np.empty(n_decisions + 1)
    moving, arrived = np.where(goal, 0.0, share), float(share[goal].sum())
    cdf[0] = arrived
    onward = chain.T.tocsr()
    for decision in range(1, n_decisions + 1):
        moving = onward @ moving
        arrived += float(moving[goal].sum())
        moving[goal] = 0.0
        cdf[decision] = arrived
    return ArrivalTimes(
        decisions=np.arange(n_decisions + 1),
        cdf=np.minimum(cdf, 1.0),
        arrival_probability=float(np.dot(share, probability_of_ever_arriving(chain, goal))),
    )


def goal_mask(problem: GoalProblem) -> BoolArray:
    """(S,) which states count as arrived: those of `goal_states`, numbers or an (S,) mask.

    SerdError where a goal is no state of the problem.
    """
    require_problem(problem, "goal_states", "NavigationProblem")
    n_states = problem.mdp.n_states
    mask = np.zeros(n_states, dtype=np.bool_)
    mask[chosen_indices("goal_states", problem.goal_states, n_states, "a state")] = True
    return mask


def policy_chain(
    mdp: Mdp, policy: FloatArray, outcome_probabilities: FloatArray | None
) -> scipy.sparse.csr_array:
    """(S, S) Markov chain of an (S, A) policy; None for transitions without parameters."""
    choice = checked_policy("policy", policy, mdp)
    transitions = transitions_of(mdp.transitions, outcome_probabilities)
    entries = transitions.entries * choice.ravel()[mdp.transitions.row]
    state = mdp.transitions.row // mdp.n_actions
    shape = (mdp.n_states, mdp.n_states)
    return scipy.sparse.csr_array((entries, (state, mdp.transitions.successor)), shape=shape)


@dataclass(frozen=True, eq=False)
class ArrivalByState:
    """cdf: (n_steps + 1, S) F_n(s); arrival_probability: (S,) of ever arriving.

    A step is a decision, or where decisions take time a step of time.
    """

    cdf: FloatArray
    arrival_probability: FloatArray

    @classmethod
    def average(cls, each: Iterable["ArrivalByState"]) -> "ArrivalByState":
        """Posterior prediction from that of each draw, of which one is held at a time."""
        cdf, probability, number = np.zeros(()), np.zeros(()), 0
        for one in each:
            cdf, probability = cdf + one.cdf, probability + one.arrival_probability
            number += 1
        return cls(cdf / number, probability / number)

    @property
    def n_steps(self) -> int:
        """The horizon."""
        return len(self.cdf) - 1

    @cached_property
    def mean_steps(self) -> FloatArray:
        """(S,) mean of min(steps until arrival, horizon): sum over n < horizon of 1 - F_n."""
        return np.asarray((1.0 - self.cdf[:-1]).sum(axis=0))

    def within(self, n_steps: int) -> FloatArray:
        """(S,) probability of arriving within so many steps; the horizon where it is beyond."""
        return np.asarray(self.cdf[min(max(n_steps, 0), self.n_steps)])
