"""The policy that is driven: the learned one where it arrives, the way of least time elsewhere.

Trap states (Fig. 5.11 of the thesis) are *looping*, where the chain of intended cells runs into a
cycle instead of a goal, or *unlikely*, where the policy arrives within the horizon with less than a
threshold probability. Chance may free a robot from a cycle, which is why outcomes are left out of
the first. There the policy of the least expected time is taken, which solves the stochastic
shortest path problem (Bertsekas and Tsitsiklis, Mathematics of Operations Research 16, 1991)

    V(s) = min_a E[tau | s, a] + sum_s' P(s'|s,a) V(s'),    V(goal) = 0

over the actions that are meant to lead to another cell. Each decision ends the drive with the
probability 1 / `NEVER`, so V is finite, and arriving comes first, and then the time.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse

from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.arrival.chain import can_reach, goal_mask
from serd_core.grid.navigation import NavigationProblem
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.solved_policy import Policy, optimal_policy


@dataclass(frozen=True, eq=False)
class Traps:
    """looping, unlikely: (S,) masks."""

    looping: BoolArray
    unlikely: BoolArray

    @property
    def states(self) -> IntArray:
        """Indices of the states that are trapped in either way."""
        return np.flatnonzero(self.looping | self.unlikely)

    def __contains__(self, state: int) -> bool:
        return bool(self.looping[state] or self.unlikely[state])


def trap_states(
    neighbours: IntArray, policy: IntArray | FloatArray, goal_states: IntArray
) -> BoolArray:
    """(S,) mask of the looping states.

    neighbours: (S, A) next cell of each intended move; policy: (S,) the action of each state, or
    (S, A) probabilities of actions; goal_states: (G,).

    >>> trap_states(np.array([[0, 1], [0, 2], [1, 2]]), np.array([1, 1, 1]), np.array([2]))
    array([False, False, False])
    """
    n_states, n_actions = neighbours.shape
    taken = policy > 0 if policy.ndim == 2 else policy[:, None] == np.arange(n_actions)
    state, action = np.nonzero(taken)
    steps = np.ones(len(state)), (state, neighbours[state, action])
    goal = np.isin(np.arange(n_states), goal_states)
    return ~can_reach(scipy.sparse.csr_array(steps, shape=(n_states, n_states)), goal)


#: Expected decisions of a drive that never arrives.
NEVER = 1e9
#: A state that arrives before the time-out with less than this probability is called a trap.
TRAP_PROBABILITY = 0.5


def likely_by_moments(mean_s: FloatArray, square_s2: FloatArray, within_s: float) -> BoolArray:
    """(S,) where mean and mean square of a time prove that it ends in time with probability 1/2.

    Cantelli: P(T > t) <= v / (v + (t - m)^2) for the variance v and a mean m below t.

    >>> likely_by_moments(np.array([1.0, 1.0, 3.0]), np.array([1.5, 9.0, 9.0]), 2.0)
    array([ True, False, False])
    """
    left_s = within_s - mean_s
    with np.errstate(invalid="ignore"):  # inf where it is not certain that it ends
        return np.asarray((left_s > 0) & (square_s2 - mean_s**2 <= left_s**2))


@dataclass(frozen=True, eq=False)
class ArrivingPolicy:
    """A policy that leaves the traps of a learned one by the way of least expected time.

    policy: the one to drive; its value and q are those of the learned policy. by_time: (S,) states
    in which the way of least expected time is taken. learned_traps: of the learned policy. traps:
    states from which neither arrives.
    """

    policy: Policy
    by_time: BoolArray
    learned_traps: Traps
    traps: Traps


def arriving_policy(
    problem: NavigationProblem,
    learned: Policy,
    outcome_probabilities: FloatArray,
    seconds: FloatArray,
    likely_of: Callable[[Policy], BoolArray],
) -> ArrivingPolicy:
    """The learned policy with the way of least expected time in every state that is trapped.

    outcome_probabilities: (M, K); seconds: (S, A) mean of each decision. likely_of: returns the
    (S,) states from which a policy arrives before the time-out with `TRAP_PROBABILITY` at least. A
    state from which the learned policy alone arrives, but not where it meets such a way, takes that
    way too.
    """

    def traps_of(policy: Policy) -> Traps:
        looping = trap_states(problem.grid.neighbours, policy.probabilities, problem.goal_states)
        return Traps(looping, ~likely_of(policy))

    driven, traps = learned, traps_of(learned)
    learned_traps, by_time = traps, np.zeros(len(learned.greedy), dtype=np.bool_)
    if not len(traps.states):
        return ArrivingPolicy(driven, by_time, learned_traps, traps)
    fastest = least_time_policy(problem, outcome_probabilities, seconds)
    while (more := (traps.looping | traps.unlikely) & ~by_time).any():
        by_time |= more
        driven = replace(
            learned,
            probabilities=np.where(by_time[:, None], fastest.probabilities, learned.probabilities),
            greedy=np.where(by_time, fastest.greedy, learned.greedy),
        )
        traps = traps_of(driven)
    lost = traps.unlikely
    if lost.any():
        lost = lost & ~likely_of(fastest)
    traps = Traps(traps.looping & lost, lost)
    return ArrivingPolicy(driven, by_time, learned_traps, traps)


def least_time_policy(
    problem: NavigationProblem, outcome_probabilities: FloatArray, seconds: FloatArray
) -> Policy:
    """The policy of the least expected time to a goal, which is its -value in seconds.

    outcome_probabilities: (M, K); seconds: (S, A) mean of each. Waits where no action leads on.
    """
    models = problem.outcome_models
    assert models.intended is not None  # of every navigation problem
    intended = np.asarray(models.intended)[models.model_of][:, :, None]
    aimed_at = np.take_along_axis(models.successors, intended, axis=2)[:, :, 0]
    moves = models.available & (aimed_at != np.arange(models.n_states)[:, None])
    available = np.where(moves.any(axis=1, keepdims=True), moves, models.available)
    mdp = Mdp(replace(models, available=available), 1.0 - 1.0 / NEVER)
    cost = np.where(goal_mask(problem)[:, None], 0.0, -np.asarray(seconds))
    timed = TabularProblem(mdp, cost[:, :, None], ("seconds",))
    return optimal_policy(timed, np.ones(1), outcome_probabilities)
