"""Decisions as trajectories tau, and their discounted feature counts phi(tau).

    phi(tau) = sum_t gamma^t f(s_t, a_t)

Time counts in decisions from the first of each trajectory: an episode, or where decisions of it
are missing each piece in between, which is a trajectory from where it starts
(`serd_core.demonstrations.decisions.rows_by_trajectory`).
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, IntArray, weighted_counts
from serd_core.demonstrations.decisions import Decisions, require_shown, rows_by_trajectory
from serd_core.mdp.problem import Problem


@dataclass(frozen=True, eq=False)
class Trajectories:
    """N trajectories, in the order of their episodes and times.

    of_decision, step: (n,) index of the trajectory and time step of each decision.
    episode: (N,) number of the episode each is (a piece) of.
    start, end: (N,) first state and state after the last decision; length: (N,) decisions.
    """

    of_decision: IntArray
    step: IntArray
    episode: IntArray
    start: IntArray
    end: IntArray
    length: IntArray

    def __len__(self) -> int:
        return len(self.start)


def trajectories_of(decisions: Decisions) -> Trajectories:
    """Decisions in the order of their times, split into episodes and where some are missing."""
    rows, begins = rows_by_trajectory(decisions)
    first = np.flatnonzero(begins)
    length = np.diff(np.append(first, len(rows)))
    of_decision, step = np.empty((2, len(rows)), dtype=np.int64)
    of_decision[rows] = np.cumsum(begins) - 1
    step[rows] = np.arange(len(rows)) - np.repeat(first, length)
    return Trajectories(
        of_decision=of_decision,
        step=step,
        episode=decisions.episode[rows[first]],
        start=decisions.state[rows[first]],
        end=decisions.next_state[rows[first + length - 1]],
        length=length.astype(np.int64),
    )


def absorption_features(problem: Problem) -> FloatArray:
    """(S, F) what a final state (`Mdp.final`) collects forever: f / (1 - gamma)."""
    mdp = problem.mdp
    only_action = mdp.available.argmax(axis=1)
    forever = problem.features[np.arange(mdp.n_states), only_action] / (1.0 - mdp.discount)
    return np.asarray(forever * mdp.final[:, None])


def cut_off_ends(problem: Problem, decisions: Decisions) -> FloatArray:
    """(S,) mean over trajectories of gamma^T at the state after their T decisions, where it is no
    final state: where trajectories were cut off."""
    mdp, episodes = problem.mdp, trajectories_of(decisions)
    weight = mdp.discount ** episodes.length.astype(np.float64) / len(episodes)
    return np.where(mdp.final, 0.0, weighted_counts(episodes.end, weight, mdp.n_states))


def feature_counts(problem: Problem, decisions: Decisions) -> FloatArray:
    """(N, F) phi of each trajectory, with what follows where it ended in a final state."""
    require_shown(decisions, "features of trajectories")
    episodes, discount = trajectories_of(decisions), problem.mdp.discount
    weight = discount ** episodes.step.astype(np.float64)
    observed = problem.features[decisions.state, decisions.action] * weight[:, None]
    counts = np.zeros((len(episodes), observed.shape[1]))
    np.add.at(counts, episodes.of_decision, observed)
    reached = discount ** episodes.length.astype(np.float64)
    return np.asarray(counts + absorption_features(problem)[episodes.end] * reached[:, None])
