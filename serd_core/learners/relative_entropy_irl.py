"""Relative entropy IRL (section 3.2.4): model-free, by importance sampling.

The distribution over trajectories closest to a baseline Q(tau) that matches the features within
thresholds is P(tau) proportional to Q(tau) exp(theta . phi(tau)) (3.43). Its dual

    g(theta) = theta . phi~ - log Z(theta) - sum_i epsilon_i |theta_i|

is estimated from trajectories sampled by a known policy pi_a, weighted by U_Q / U_a (3.45, 3.46),
U_pi(tau) = prod_t pi(a_t | s_t). A demonstration that was cut off after T decisions is compared
with the first T of each sample. theta is split into positive and negative parts, which makes the
subgradient (3.44) an ordinary gradient under bounds. Thresholds are Hoeffding's, epsilon_i =
R_i sqrt(log(2 / (1 - confidence)) / (2 n)), R_i from the least to the greatest count of feature i.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from serd_core import checks
from serd_core.arrays import FloatArray, described, weighted_counts
from serd_core.ascent.ascent import (
    Ascent,
    Climb,
    FunctionObjective,
    Point,
    StepCallback,
    minimise,
    vanishing,
)
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import observe
from serd_core.demonstrations.simulation import feature_counts, trajectories_of
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult
from serd_core.learners.start import reward_names, reward_search
from serd_core.mdp.problem import Problem, require_problem
from serd_core.policies.solved_policy import MdcePolicy, Policy

#: What bounds or determines the weights.
THRESHOLDS = "give thresholds above 0"


def fit_relative_entropy_irl(
    problem: Problem,
    decisions: Decisions,
    *,
    samples: Decisions,
    sampling_policy: Policy | FloatArray,
    thresholds: FloatArray,
    initial_weights: FloatArray | None = None,
    rng: np.random.Generator | None = None,
    dynamics: FloatArray | None = None,
    largest_weight: float = 100.0,
    gradient_tolerance: float = 1e-6,
    max_steps: int = 5_000,
    on_step: StepCallback | None = None,
) -> FitResult:
    """Learn reward weights from demonstrations and samples of the real dynamics (section 3.2.4).

    Model-free: maximises g (3.43) with importance weights of the samples.

    samples: episodes made by `sampling_policy` (S, A), at least as long as demonstrations that were
    cut off. The baseline is the uniform policy.
    thresholds: (F,) epsilon, such as `hoeffding_thresholds`; zeros for exact matching.
    initial_weights: (F,) to start from; None draws them from U[-10, 10] by `rng`.
    dynamics: (M, K), or parameters of timed ones, None for the M-estimate; for the policy of
    the weights, the fit itself does not use them.
    Where the demonstrated features lie outside what the samples span, the dual grows without bound;
    weights then stop at `largest_weight`, in units of one over the range of their feature, and the
    fit has not converged.
    gradient_tolerance, max_steps: of L-BFGS; on_step: called after each step, True stops it.
    Returns a `FitResult`; raises SerdError for hidden actions and wrong arguments.

        fit = sc.fit_relative_entropy_irl(
            problem, decisions, samples=samples, sampling_policy=policy,
            thresholds=sc.hoeffding_thresholds(problem, 30), rng=rng)
    """
    checks.require_positive("largest_weight", largest_weight, "use 100")
    search = reward_search(problem, decisions, MdcePolicy(), initial_weights, rng, dynamics)
    given = checks.float_array("thresholds", thresholds, (len(problem.feature_names),))
    checks.require_each(
        "thresholds", given, given >= 0, "not be negative", "use 0 for exact matching"
    )
    observe(problem, samples, name="samples")
    scale, groups = search.scale, list[SampleGroup]()
    for share, seen in _as_long_as(problem, decisions, samples):
        log_weights = importance_log_weights(problem, seen, sampling_policy)
        groups.append(SampleGroup(share, scale * feature_counts(problem, seen), log_weights))
    wanted = scale * feature_counts(problem, decisions).mean(axis=0)
    dual = SampledDual(wanted, tuple(groups), scale * given, scale)
    start = search.start.reward / scale
    ascent = _BoundedAscent(
        dual, reward_names(problem), largest_weight, gradient_tolerance, max_steps
    )
    halves = np.clip(np.concatenate([start, -start]), 0.0, largest_weight)
    ended = ascent.maximise(FunctionObjective(dual.evaluate), halves, on_step)
    of_weights, n_episodes = FunctionObjective(dual.evaluate_weights), len(decisions.episodes)
    return search.result(ended, of_weights, THRESHOLDS, n_episodes)


@dataclass(frozen=True, eq=False)
class SampleGroup:
    """Samples for a share of the demonstrations: (N, F) features and (N,) log U_Q / U_a."""

    share: float
    sampled: FloatArray
    log_weights: FloatArray

    def log_z(self, weights: FloatArray) -> tuple[float, FloatArray]:
        """log Z and its (F,) gradient, both times the share."""
        log_terms = self.log_weights + self.sampled @ weights
        highest = float(log_terms.max())
        term = np.exp(log_terms - highest)
        log_z = highest + float(np.log(term.mean()))
        return self.share * log_z, self.share * (term @ self.sampled / term.sum())


def _as_long_as(
    problem: Problem, decisions: Decisions, samples: Decisions
) -> Iterator[tuple[float, Decisions]]:
    """Share of the demonstrations that are complete, or were cut off at one time, with the samples
    to compare them with."""
    demonstrated, drawn = trajectories_of(decisions), trajectories_of(samples)
    is_cut = ~problem.mdp.final[demonstrated.end]
    whole = drawn.length[~problem.mdp.final[drawn.end]]
    if not is_cut.all():
        # They were complete before the others were cut off.
        most = demonstrated.length[is_cut].max(initial=0) or drawn.length.max()
        yield float(np.mean(~is_cut)), samples.select(drawn.step < most)
    for length in np.unique(demonstrated.length[is_cut]).tolist():
        if len(whole) and whole.min() < length:
            raise SerdError(
                f"samples must be at least as long as demonstrations that were cut off after"
                f" {length} decisions, got {whole.min()}; sample {length} decisions"
            )
        share = float(np.mean(is_cut & (demonstrated.length == length)))
        yield share, samples.select(drawn.step < length)


@dataclass(frozen=True, eq=False)
class SampledDual:
    """g(theta) on samples, by the positive and negative parts of theta / scale, (2 F,) in a row.

    wanted: (F,) phi~; thresholds: (F,) epsilon; they and all features are times scale (F,).
    """

    wanted: FloatArray
    groups: tuple[SampleGroup, ...]
    thresholds: FloatArray
    scale: FloatArray

    def evaluate(self, halves: FloatArray) -> tuple[float, FloatArray]:
        """g and its (2 F,) gradient."""
        weights = self._weights(halves)
        sums, expected = zip(*(group.log_z(weights) for group in self.groups), strict=True)
        log_z, gradient = sum(sums), self.wanted - np.sum(expected, axis=0)
        slack = float(np.tile(self.thresholds, 2) @ halves)
        both = np.concatenate([gradient - self.thresholds, -gradient - self.thresholds])
        return float(weights @ self.wanted) - log_z - slack, both

    def evaluate_weights(self, weights: FloatArray) -> tuple[float, FloatArray]:
        """g and a (F,) gradient by theta / scale."""
        parts = np.maximum(np.concatenate([weights, -weights]), 0.0)
        value, gradient = self.evaluate(parts)
        above, below = np.split(gradient, 2)
        return value, np.where(weights >= 0, above, -below)

    def _weights(self, halves: FloatArray) -> FloatArray:
        return halves[: len(self.wanted)] - halves[len(self.wanted) :]

    def at(self, halves: FloatArray) -> Point:
        """The weights with g and the gradient that is left once parts held at 0 are taken out."""
        value, gradient = self.evaluate(halves)
        free = np.where((halves > 0) | (gradient > 0), gradient, 0.0)
        return Point(self.scale * self._weights(halves), value, free)


@dataclass(frozen=True, eq=False)
class _BoundedAscent(Ascent):
    """L-BFGS over halves from 0 to `largest_weight`; its points are the weights of the halves."""

    dual: SampledDual
    names: list[str]
    largest_weight: float
    gradient_tolerance: float
    max_steps: int

    def tries(self, climb: Climb) -> Iterator[None]:
        """Run SciPy's L-BFGS-B once."""
        halves = climb.here.vector
        climb.here = self.dual.at(halves)
        climb.judge(*vanishing(climb.here, self.gradient_tolerance))
        yield

        def accept(vector: FloatArray) -> None:
            nonlocal halves
            halves, point = vector.copy(), self.dual.at(vector)
            climb.accept(point, *vanishing(point, self.gradient_tolerance))

        bounds = [(0.0, self.largest_weight)] * len(halves)
        limits = {"gtol": self.gradient_tolerance, "maxiter": self.max_steps}
        climb.stalled = f"not converged: {minimise(climb, halves, accept, bounds, **limits)}"
        stuck = np.max(halves.reshape(2, -1), axis=0) >= self.largest_weight
        if stuck.any():
            bound = np.where(stuck, climb.here.vector / self.dual.scale, 0.0)
            way = described(bound, self.names)
            climb.stalled = (
                f"not converged: weights reached largest_weight along {way}; take more samples"
            )


def importance_log_weights(
    problem: Problem, samples: Decisions, sampling_policy: Policy | FloatArray
) -> FloatArray:
    """(N,) log U_Q(tau) - log U_a(tau) of each sampled trajectory, Q being uniform."""
    available = problem.mdp.available
    given = getattr(sampling_policy, "probabilities", sampling_policy)
    made_by = checks.float_array("sampling_policy", given, available.shape)
    chosen = made_by[samples.state, samples.action]
    if (bad := np.flatnonzero(~(chosen > 0))).size:
        first = int(bad[0])
        raise SerdError(
            "sampling_policy must be above 0 wherever the samples went, got"
            f" {chosen[first]} for state {samples.state[first]}, action {samples.action[first]};"
            " smooth that policy"
        )
    episodes, n_available = trajectories_of(samples), available.sum(axis=1)[samples.state]
    uniform = (available[samples.state, samples.action] / n_available).astype(np.float64)
    return weighted_counts(episodes.of_decision, np.log(uniform) - np.log(chosen), len(episodes))


def hoeffding_thresholds(
    problem: Problem, n_episodes: int, confidence: float = 0.95, horizon: float = np.inf
) -> FloatArray:
    """(F,) half-widths within which the mean discounted features lie with that confidence.

    horizon: most decisions of an episode.

        thresholds = sc.hoeffding_thresholds(problem, len(decisions.episodes), horizon=50)
    """
    require_problem(problem)
    checks.require_share("confidence", confidence)
    checks.require_count("n_episodes", n_episodes, 1, "100")
    observable, discount = problem.features[problem.mdp.available], problem.mdp.discount
    series = (1.0 - discount**horizon) / (1.0 - discount)
    spread = series * observable.max(axis=0) - series * observable.min(axis=0)
    return np.asarray(spread * np.sqrt(np.log(2.0 / (1.0 - confidence)) / (2.0 * n_episodes)))
