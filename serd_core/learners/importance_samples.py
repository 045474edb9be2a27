"""Samples for relative entropy IRL: making them, weighting them, and how exact they can be.

    U_pi(tau) = prod_t pi(a_t | s_t)

A sampled trajectory counts with U_Q(tau) / U_a(tau): the dynamics under the baseline and under the
sampling policy are the same and drop out (3.46).
"""

import numpy as np

from serd_core.arrays import FloatArray, float_array, require_share, weighted_counts
from serd_core.demonstrations.decisions import Decisions, start_distribution
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.demonstrations.trajectories import trajectories_of
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.errors import SerdError
from serd_core.learners.behavioural_cloning import clone_behaviour
from serd_core.mdp.problem import Problem


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
    """(N,) log U_Q(tau) - log U_a(tau) of each sampled trajectory."""
    available = problem.mdp.available
    uniform = available / available.sum(axis=1, keepdims=True)
    baseline = uniform if baseline_policy is None else baseline_policy
    made_by = _chosen("sampling_policy", sampling_policy, available.shape, samples)
    wanted_by = _chosen("baseline_policy", baseline, available.shape, samples)
    episodes = trajectories_of(samples)
    return weighted_counts(episodes.of_decision, np.log(wanted_by) - np.log(made_by), len(episodes))


def hoeffding_thresholds(
    problem: Problem,
    n_episodes: int,
    confidence: float = 0.95,
    horizon: float = np.inf,
    shortest: float | None = None,
) -> FloatArray:
    """(F,) half-widths within which the mean discounted features lie with that confidence.

    horizon, shortest: most and fewest decisions of an episode; None where all have the most.
    """
    require_share("confidence", confidence)
    if not n_episodes >= 1:
        raise SerdError(f"n_episodes must be at least 1, got {n_episodes}; record an episode")
    observable = problem.features[problem.mdp.available]
    discount = problem.mdp.discount
    lengths = np.array([horizon, horizon if shortest is None else shortest], dtype=np.float64)
    series = (1.0 - discount**lengths) / (1.0 - discount)
    # Counts grow or shrink with the length, so their extremes lie at one of the two.
    spread = np.max(np.outer(series, observable.max(axis=0)), axis=0)
    spread -= np.min(np.outer(series, observable.min(axis=0)), axis=0)
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
