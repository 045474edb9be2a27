"""Maximum entropy IRL (section 3.2.2): a Boltzmann distribution over whole trajectories.

    P(tau | s0, T) = exp(theta . phi(tau)) prod_t P(s_{t+1} | s_t, a_t) / Z_T(s0)        (3.21)

phi holds discounted feature counts; for stochastic dynamics this is Ziebart's form with the
dynamics as base measure. Every observed episode is compared with all trajectories of its own start
and length. The log-likelihood per episode is concave and its gradient is phi~ minus expected counts
(3.22). (3.19) as printed has the sign of theta that would give exp(-theta . phi).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from serd_core.arrays import FloatArray, weighted_counts
from serd_core.ascent.ascent import LBFGS, Ascent, StepCallback
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import absorption_features, feature_counts, trajectories_of
from serd_core.dynamics.transition_model import Transitions
from serd_core.learners.fit_result import FitResult
from serd_core.learners.start import reward_search
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import SOFT, MdcePolicy


def fit_maxent_irl(
    problem: Problem,
    decisions: Decisions,
    *,
    initial_weights: FloatArray | None = None,
    rng: np.random.Generator | None = None,
    dynamics: FloatArray | None = None,
    ascent: Ascent = LBFGS,
    on_step: StepCallback | None = None,
) -> FitResult:
    """Learn the reward weights under which the demonstrated trajectories are most likely (3.21).

    The probability of a trajectory, among those of its length from its start, is in proportion to
    exp(reward) times that of its moves. The objective is the mean log-likelihood per episode.

    initial_weights, rng, dynamics, ascent, on_step: as in `fit_mdce_irl_by_likelihood`.
    Returns a `FitResult`; raises SerdError for hidden actions and wrong arguments.

        fit = sc.fit_maxent_irl(problem, decisions, rng=np.random.default_rng(0))
    """
    search = reward_search(problem, decisions, MdcePolicy(), initial_weights, rng, dynamics)
    model = TrajectoryModel(problem, search.transitions)
    episodes = trajectories_of(decisions)
    demonstrated = feature_counts(problem, decisions).mean(axis=0)

    def log_likelihood(weights: FloatArray) -> tuple[float, FloatArray]:
        log_z, expected = 0.0, np.zeros_like(weights)
        for length in np.unique(episodes.length):
            starts = np.bincount(
                episodes.start[episodes.length == length], minlength=problem.mdp.n_states
            )
            part, counts = model.partition(weights, starts / len(episodes), int(length))
            log_z, expected = log_z + part, expected + counts
        return float(weights @ demonstrated) - log_z, demonstrated - expected

    return search.maximise(log_likelihood, ascent, on_step, n_observations=len(episodes))


@dataclass(frozen=True, eq=False)
class TrajectoryModel:
    """Sums over all trajectories by recursion over time, in logarithms."""

    problem: Problem
    transitions: Transitions

    def partition(
        self, weights: FloatArray, starts: FloatArray, length: int
    ) -> tuple[float, FloatArray]:
        """sum_s starts(s) log Z_T(s) and its (F,) gradient: expected feature counts."""
        mdp, features = self.problem.mdp, self.problem.features
        rewards = features @ weights
        ends = absorption_features(self.problem) * mdp.discount**length
        log_z, choices, moves = ends @ weights, [], []
        for step in reversed(range(length)):
            onward, move = self._expected_exponential(log_z)
            q = mdp.discount**step * rewards + onward  # -inf where an action is unavailable
            log_z = SOFT.maximum(q)
            choices.append(SOFT.policy_at(q, log_z))
            moves.append(move)
        total = float(starts @ log_z)
        share, expected = np.array(starts, dtype=np.float64), np.zeros(features.shape[2])
        for step in range(length):
            pairs = share[:, None] * choices.pop()
            expected += mdp.discount**step * np.tensordot(pairs, features, axes=2)
            flow = pairs.ravel()[mdp.transitions.row] * moves.pop()
            share = weighted_counts(mdp.transitions.successor, flow, mdp.n_states)
        return total, expected + share @ ends

    @cached_property
    def _log_entries(self) -> FloatArray:
        """(E,) log P, -inf where a transition is impossible: values would make up for any floor."""
        entries = self.transitions.entries
        return np.log(entries, out=np.full(len(entries), -np.inf), where=entries > 0)

    def _expected_exponential(self, log_z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(S, A) log sum_s' P z(s'), and (E,) share of each entry in its row's sum."""
        model = self.transitions.model
        terms = self._log_entries + log_z[model.successor]
        first = model.row_start[:-1][model.available.ravel()]
        lengths = np.diff(np.append(first, len(terms)))
        highest = np.maximum.reduceat(terms, first)
        shifted = np.exp(terms - np.repeat(highest, lengths))
        sums = np.add.reduceat(shifted, first)
        onward = np.full(model.available.size, -np.inf)
        onward[model.available.ravel()] = highest + np.log(sums)
        return onward.reshape(model.available.shape), shifted / np.repeat(sums, lengths)
