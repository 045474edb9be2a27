"""The absorbing chain of a policy, and the arrival from each of its states (Fig. 5.10).

The chain P_pi[s, s'] = sum_a pi(a|s) P(s'|s,a) moves one decision at a time; what has reached a
goal state has arrived. The probability of ever arriving is the least solution of h = P h, h = 1 at
a goal, by elimination without subtractions (Grassmann, Taksar and Heyman, Operations Research 33,
1985): a state's exit rate is the sum of its ways out, never 1 - p(s|s), which cancels to nothing
once leaving is rarer than machine precision. It works on logarithms, as the chance of several rare
steps soon passes the smallest number. What is certain is found by search, not computed.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph
from numpy.lib.stride_tricks import as_strided

from serd_core.arrays import BoolArray, FloatArray, IntArray, chosen_indices
from serd_core.dynamics.transition_model import transitions_of
from serd_core.mdp.mdp import Mdp, checked_policy
from serd_core.mdp.problem import require_problem


class GoalProblem(Protocol):
    """An MDP with goal states, such as `NavigationProblem`."""

    @property
    def mdp(self) -> Mdp:
        """The MDP."""

    @property
    def goal_states(self) -> IntArray:
        """Indices of the states that count as arrived."""


def goal_mask(problem: GoalProblem) -> BoolArray:
    """(S,) which states count as arrived: those of `goal_states`, numbers or an (S,) mask."""
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


def probability_of_ever_arriving(chain: scipy.sparse.csr_array, goal: BoolArray) -> FloatArray:
    """(S,) probability of ever being in a goal state, for a start in each state."""
    steps = scipy.sparse.coo_array(chain)
    steps.sum_duplicates()
    kept = (steps.data > 0) & (steps.row != steps.col) & ~goal[steps.row]
    places = steps.row[kept], steps.col[kept]
    onward = scipy.sparse.csr_array((steps.data[kept], places), shape=steps.shape)
    lost = ~can_reach(onward, goal)
    open_states = np.flatnonzero(can_reach(onward, lost) & ~lost)
    arriving = np.where(lost, 0.0, 1.0)
    if open_states.size:
        arriving[open_states] = _arriving_of_open_states(onward, open_states, ~lost)
    return arriving


def can_reach(onward: scipy.sparse.csr_array, target: BoolArray) -> BoolArray:
    """(S,) whether a target (S,) can be reached by the steps of a graph (S, S), or is there."""
    reversed_graph = scipy.sparse.csr_array(onward.T)
    reaches, new = np.array(target, dtype=np.bool_), np.flatnonzero(target)
    while len(new):
        before = np.unique(reversed_graph[new].indices)
        new = before[~reaches[before]]
        reaches[new] = True
    return reaches


def _arriving_of_open_states(
    onward: scipy.sparse.csr_array, open_states: IntArray, not_lost: BoolArray
) -> FloatArray:
    """(n,) probabilities of the states that may arrive and may get lost."""
    inner = onward[open_states][:, open_states]
    symmetric = scipy.sparse.csr_array(inner + inner.T)
    order = scipy.sparse.csgraph.reverse_cuthill_mckee(symmetric, symmetric_mode=True)
    ordered = open_states[order]
    is_open = np.isin(np.arange(len(not_lost)), open_states)
    rows = onward[ordered]
    share = _eliminated(
        rows[:, ordered],
        to_goal=rows[:, np.flatnonzero(not_lost & ~is_open)].sum(axis=1),
        to_lost=rows[:, np.flatnonzero(~not_lost)].sum(axis=1),
    )
    arriving = np.empty(len(open_states))
    arriving[order] = share
    return arriving


def _eliminated(
    inner: scipy.sparse.csr_array, to_goal: FloatArray, to_lost: FloatArray
) -> FloatArray:
    """(n,) share that arrives, from the rates (n, n) within and (n,) out of n states."""
    n_states = len(to_goal)
    band, width = _log_band(inner)
    with np.errstate(divide="ignore"):
        goal, lost = np.log(to_goal), np.log(to_lost)
    for k in range(n_states):
        last = min(k + width, n_states - 1)
        block, after = _block(band, width, k, last), slice(k + 1, last + 1)
        exit_rate = np.logaddexp.reduce([*block[0, 1:], goal[k], lost[k]])
        block[0, 1:] -= exit_rate
        goal[k] -= exit_rate
        lost[k] -= exit_rate
        into = block[1:, 0]
        block[1:, 1:] = np.logaddexp(block[1:, 1:], into[:, None] + block[0, 1:])
        goal[after] = np.logaddexp(goal[after], into + goal[k])
        lost[after] = np.logaddexp(lost[after], into + lost[k])
        np.fill_diagonal(block[1:, 1:], -np.inf)
    return _substituted(band, width, goal)


def _substituted(band: FloatArray, width: int, goal: FloatArray) -> FloatArray:
    """(n,) shares from the last state, whose goal share is all there is, back to the first."""
    share: FloatArray = np.exp(goal)
    last_state = len(goal) - 1
    for k in range(last_state, -1, -1):
        last = min(k + width, last_state)
        share[k] += np.exp(_block(band, width, k, last)[0, 1:]) @ share[k + 1 : last + 1]
    np.minimum(share, 1.0, out=share)
    return share


def _log_band(inner: scipy.sparse.csr_array) -> tuple[FloatArray, int]:
    """(n, 2 w + 1) logarithms [s, s' - s + w] of a matrix of half bandwidth w, and w."""
    entries = scipy.sparse.coo_array(inner)
    offset = entries.col.astype(np.int64) - entries.row
    width = int(np.abs(offset).max(initial=0))
    band = np.full((entries.shape[0], 2 * width + 1), -np.inf)
    band[entries.row, offset + width] = np.log(entries.data)
    return band, width


def _block(band: FloatArray, width: int, first: int, last: int) -> FloatArray:
    """A square view of rows and columns first..last of a banded matrix; last <= first + w."""
    size, number_bytes = last - first + 1, band.itemsize
    corner = band.ravel()[first * (2 * width + 1) + width :]
    strides = (2 * width * number_bytes, number_bytes)
    return as_strided(corner, shape=(size, size), strides=strides)
