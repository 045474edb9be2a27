"""Decisions as trajectories tau, and their discounted feature counts phi(tau).

    phi(tau) = sum_t gamma^t f(s_t, a_t)

Time counts from the first decision of each episode.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations import Decisions
from serd_core.problem import Problem


@dataclass(frozen=True, eq=False)
class Trajectories:
    """N episodes, in the order of their numbers.

    of_decision, step: (n,) episode index and time step of each decision.
    start, end: (N,) first state and state after the last decision; length: (N,) decisions.
    """

    of_decision: IntArray
    step: IntArray
    start: IntArray
    end: IntArray
    length: IntArray

    def __len__(self) -> int:
        return len(self.start)


def trajectories_of(decisions: Decisions) -> Trajectories:
    """Split decisions into episodes, keeping the order of rows within each."""
    _, of_decision, length = np.unique(decisions.episode, return_inverse=True, return_counts=True)
    order = np.argsort(of_decision, kind="stable")
    first = np.concatenate([[0], np.cumsum(length)[:-1]]).astype(np.int64)
    step = np.empty(len(decisions), dtype=np.int64)
    step[order] = np.arange(len(decisions)) - np.repeat(first, length)
    return Trajectories(
        of_decision=of_decision.reshape(-1),
        step=step,
        start=decisions.state[order[first]],
        end=decisions.next_state[order[first + length - 1]],
        length=length.astype(np.int64),
    )


def discounted_features(problem: Problem, decisions: Decisions) -> FloatArray:
    """(N, F) phi of each episode over its observed decisions."""
    episodes = trajectories_of(decisions)
    weight = problem.mdp.discount ** episodes.step.astype(np.float64)
    observed = problem.features[decisions.state, decisions.action] * weight[:, None]
    counts = np.zeros((len(episodes), observed.shape[1]))
    np.add.at(counts, episodes.of_decision, observed)
    return counts


def absorption_features(problem: Problem) -> FloatArray:
    """(S, F) what an absorbing state with one action collects forever: f / (1 - gamma).

    Zero for other states: nothing is known about what would follow there.
    """
    mdp = problem.mdp
    only_action = mdp.available.argmax(axis=1)
    single = mdp.absorbing & (mdp.available.sum(axis=1) == 1)
    forever = problem.features[np.arange(mdp.n_states), only_action] / (1.0 - mdp.discount)
    return np.asarray(forever * single[:, None])


def features_after_absorption(problem: Problem, episodes: Trajectories) -> FloatArray:
    """(N, F) what phi goes on to collect where an episode ended in an absorbing state."""
    reached = problem.mdp.discount ** episodes.length.astype(np.float64)
    return np.asarray(absorption_features(problem)[episodes.end] * reached[:, None])


def feature_counts(problem: Problem, decisions: Decisions) -> FloatArray:
    """(N, F) phi of each episode, with what follows absorption."""
    following = features_after_absorption(problem, trajectories_of(decisions))
    return np.asarray(discounted_features(problem, decisions) + following)
