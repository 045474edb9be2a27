"""Relative entropy IRL (section 3.2.4): model-free, by importance sampling.

The distribution over trajectories closest to a baseline Q(tau) that matches the features within
thresholds is P(tau) proportional to Q(tau) exp(theta . phi(tau)) (3.43). Its dual

    g(theta) = theta . phi~ - log Z(theta) - sum_i epsilon_i |theta_i|

is estimated from trajectories sampled by a known policy pi_a, weighted by U_Q / U_a (3.45, 3.46).
It is concave but has kinks at 0, so theta is split into positive and negative parts, which makes
the subgradient (3.44) an ordinary gradient under bounds.

Thresholds: Hoeffding's bound for the mean of n counts within a range R_i, two-sided, gives
epsilon_i = R_i sqrt(log(2 / (1 - confidence)) / (2 n)), R_i = (max f_i - min f_i) (1 - gamma^T) /
(1 - gamma) for episodes of at most T decisions (T infinite where episodes are absorbed). They are
wide: with few demonstrations they may allow every weight to be 0. Smaller ones fit more closely.

    samples, policy = sample_from_estimates(problem, decisions, n_episodes=500, n_steps=40, rng=rng)
    fit = fit_relative_entropy_irl(
        problem, decisions, samples=samples, sampling_policy=policy, rng=rng
    )
"""

import numpy as np
import scipy.optimize

from serd_core.arrays import FloatArray, float_array, weighted_counts
from serd_core.demonstrations import Decisions, start_distribution
from serd_core.errors import SerdError
from serd_core.estimation import estimate_dynamics
from serd_core.learners.behavioural_cloning import clone_behaviour
from serd_core.learners.irl_result import IrlResult
from serd_core.learners.serd import initial_weights_or_sample
from serd_core.likelihood.observations import observe
from serd_core.problem import Problem
from serd_core.simulation import sample_decisions
from serd_core.trajectories import feature_counts, trajectories_of


def fit_relative_entropy_irl(
    problem: Problem,
    decisions: Decisions,
    *,
    samples: Decisions,
    sampling_policy: FloatArray,
    baseline_policy: FloatArray | None = None,
    thresholds: FloatArray | None = None,
    confidence: float = 0.95,
    initial_weights: FloatArray | None = None,
    rng: np.random.Generator | None = None,
    largest_weight: float = 100.0,
    gradient_tolerance: float = 1e-6,
    max_steps: int = 5_000,
) -> IrlResult:
    """Reward weights from demonstrations and samples of the real dynamics.

    samples: episodes made by `sampling_policy` (S, A); baseline_policy: (S, A), uniform if None.
    thresholds: (F,) epsilon, or None for Hoeffding's at `confidence`; zeros for exact matching.
    Where the demonstrated features lie outside what the samples span, the dual grows without bound;
    weights then stop at `largest_weight` and the fit says that it did not converge.
    """
    observe(problem.mdp, decisions)
    wanted = feature_counts(problem, decisions).mean(axis=0)
    sampled = feature_counts(problem, samples)
    log_weights = importance_log_weights(problem, samples, sampling_policy, baseline_policy)
    slack = _thresholds(problem, decisions, thresholds, confidence)

    def negative_dual(halves: FloatArray) -> tuple[float, FloatArray]:
        weights = halves[: len(wanted)] - halves[len(wanted) :]
        log_terms = log_weights + sampled @ weights
        highest = float(log_terms.max())
        share = np.exp(log_terms - highest)
        log_z = highest + float(np.log(share.mean()))
        gradient = wanted - share @ sampled / share.sum()
        value = float(weights @ wanted) - log_z - float(np.tile(slack, 2) @ halves)
        both = np.concatenate([gradient - slack, -gradient - slack])
        return -value, -both

    start = initial_weights_or_sample(problem, initial_weights, rng)
    halves = np.concatenate([np.maximum(start, 0.0), np.maximum(-start, 0.0)])
    trace: list[float] = []
    found = scipy.optimize.minimize(
        negative_dual,
        halves,
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0, largest_weight)] * len(halves),
        callback=lambda intermediate_result: trace.append(-float(intermediate_result.fun)),
        options={"gtol": gradient_tolerance, "ftol": 0.0, "maxiter": max_steps, "maxls": 40},
    )
    return _result(problem, decisions, found, trace, gradient_tolerance, largest_weight)


def sample_from_estimates(
    problem: Problem,
    decisions: Decisions,
    *,
    n_episodes: int,
    n_steps: int,
    rng: np.random.Generator,
) -> tuple[Decisions, FloatArray]:
    """Samples where only demonstrations exist, and the (S, A) policy that made them.

    As in section 4.6.2: dynamics by M-estimate, policy by smoothed behavioural cloning.
    """
    policy = clone_behaviour(problem, decisions)
    samples = sample_decisions(
        problem.mdp,
        policy,
        estimate_dynamics(problem, decisions),
        start_distribution(decisions, problem.mdp.n_states),
        n_episodes=n_episodes,
        n_steps=n_steps,
        rng=rng,
        source="sampled from estimates",
    )
    return samples, policy


def importance_log_weights(
    problem: Problem,
    samples: Decisions,
    sampling_policy: FloatArray,
    baseline_policy: FloatArray | None = None,
) -> FloatArray:
    """(N,) log U_Q(tau) - log U_a(tau) of each sampled episode."""
    available = problem.mdp.available
    uniform = available / available.sum(axis=1, keepdims=True)
    baseline = uniform if baseline_policy is None else baseline_policy
    made_by = _chosen("sampling_policy", sampling_policy, available.shape, samples)
    wanted_by = _chosen("baseline_policy", baseline, available.shape, samples)
    episodes = trajectories_of(samples)
    return weighted_counts(episodes.of_decision, np.log(wanted_by) - np.log(made_by), len(episodes))


def hoeffding_thresholds(
    problem: Problem, n_episodes: int, confidence: float = 0.95, horizon: float = np.inf
) -> FloatArray:
    """(F,) half-widths within which the mean discounted features lie with that confidence.

    horizon: most decisions of an episode.
    """
    if not 0.0 < confidence < 1.0:
        raise SerdError(f"confidence must be between 0 and 1, got {confidence}; use 0.95")
    observable = problem.features[problem.mdp.available]
    discount = problem.mdp.discount
    longest = (1.0 - discount**horizon) / (1.0 - discount)
    spread = (observable.max(axis=0) - observable.min(axis=0)) * longest
    return np.asarray(spread * np.sqrt(np.log(2.0 / (1.0 - confidence)) / (2.0 * n_episodes)))


def _chosen(
    name: str, policy: FloatArray, shape: tuple[int, ...], samples: Decisions
) -> FloatArray:
    chosen = float_array(name, policy, shape)[samples.state, samples.action]
    bad = np.flatnonzero(~(chosen > 0))
    if bad.size:
        first = int(bad[0])
        raise SerdError(
            f"{name} must be above 0 wherever the samples went, got {chosen[first]} for state"
            f" {samples.state[first]}, action {samples.action[first]}; smooth that policy"
        )
    return chosen


def _thresholds(
    problem: Problem, decisions: Decisions, thresholds: FloatArray | None, confidence: float
) -> FloatArray:
    if thresholds is None:
        episodes = trajectories_of(decisions)
        absorbed = bool(np.any(problem.mdp.absorbing[episodes.end]))
        horizon = np.inf if absorbed else float(episodes.length.max())
        return hoeffding_thresholds(problem, len(episodes), confidence, horizon)
    checked = float_array("thresholds", thresholds, (len(problem.feature_names),))
    if np.any(checked < 0):
        raise SerdError(f"thresholds must not be negative, got {checked.min()}")
    return checked


def _result(
    problem: Problem,
    decisions: Decisions,
    found: scipy.optimize.OptimizeResult,
    trace: list[float],
    gradient_tolerance: float,
    largest_weight: float,
) -> IrlResult:
    n_features = len(problem.feature_names)
    # What is left of the gradient once parts held at their bound are taken out.
    free = np.where((found.x > 0) | (found.jac < 0), found.jac, 0.0)
    norm = float(np.max(np.abs(free)))
    converged = norm <= gradient_tolerance
    stuck = bool(np.any(found.x >= largest_weight))
    reason = "weights reached largest_weight; take more samples" if stuck else found.message
    return IrlResult(
        feature_names=problem.feature_names,
        reward_weights=found.x[:n_features] - found.x[n_features:],
        outcome_probabilities=estimate_dynamics(problem, decisions),
        objective=-float(found.fun),
        gradient_norm=norm,
        n_steps=int(found.nit),
        n_evaluations=int(found.nfev),
        converged=converged,
        message="gradient within tolerance" if converged else f"not converged: {reason}",
        objective_trace=np.array(trace),
    )
