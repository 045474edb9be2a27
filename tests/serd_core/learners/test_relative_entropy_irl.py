from dataclasses import replace

import numpy as np
import pytest

from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.trajectories import feature_counts
from serd_core.dynamics.transition_model import transitions_of
from serd_core.errors import SerdError
from serd_core.grid.grid import Grid
from serd_core.grid.navigation import build_navigation_problem
from serd_core.learners.maxent_irl import TrajectoryModel
from serd_core.learners.relative_entropy_irl import (
    fit_relative_entropy_irl,
    hoeffding_thresholds,
    importance_log_weights,
    sample_from_estimates,
)
from serd_core.posterior.coordinates import feature_ranges
from support.small_problems import sampled


def uniform_samples(case, n_episodes, seed=0):
    policy = case.problem.mdp.available / 5.0
    samples = sampled(case.problem, policy, case.probabilities, n_episodes, 8, seed)
    return samples, policy


@pytest.fixture(scope="module")
def case(make_gridworld):
    return make_gridworld(side=4, n_episodes=60, n_steps=8)


def fitted(case, n_samples, threshold, weights=(0.0, 0.0), **options):
    """The fit by samples of a uniform policy."""
    samples, policy = uniform_samples(case, n_samples)
    return fit_relative_entropy_irl(
        case.problem,
        case.decisions,
        samples=samples,
        sampling_policy=policy,
        thresholds=np.full(2, threshold),
        initial_weights=np.array(weights),
        **options,
    )


def test_with_exact_matching_the_weighted_samples_have_the_features_of_the_expert(case):
    fit = fitted(case, 3000, 0.0)
    assert fit.converged
    counts = feature_counts(case.problem, uniform_samples(case, 3000)[0])
    share = np.exp(counts @ fit.reward_weights)
    matched = share @ counts / share.sum()
    wanted = feature_counts(case.problem, case.decisions).mean(axis=0)
    np.testing.assert_allclose(matched, wanted, atol=1e-4)


@pytest.mark.parametrize("unit", [1e-4, 1e5])
def test_weights_are_the_inverse_of_the_unit_of_the_features(case, unit):
    fit, other = (
        fitted(
            replace(case, problem=replace(case.problem, features=each * case.problem.features)),
            500,
            0.0,
        )
        for each in (1.0, unit)
    )
    assert fit.converged
    assert other.converged
    np.testing.assert_allclose(unit * other.reward_weights, fit.reward_weights, rtol=1e-5)


def test_many_samples_approach_the_exact_sum_over_trajectories(case):
    """With a uniform baseline the dual is that of maximum entropy up to a constant."""
    samples, _ = uniform_samples(case, 60_000)
    counts = feature_counts(case.problem, samples)
    weights = np.array([0.4, 0.6])
    share = np.exp(counts @ weights)
    sampled = share @ counts / share.sum()
    model = TrajectoryModel(
        case.problem, transitions_of(case.problem.mdp.transitions, case.probabilities)
    )
    # Trajectories of all starts share one Z here, so starts are reweighted by their own Z.
    log_z = np.array([model.partition(weights, start, 8)[0] for start in np.eye(16)])
    starts = np.exp(log_z - log_z.max())
    exact = model.partition(weights, starts / starts.sum(), 8)[1]
    np.testing.assert_allclose(sampled, exact, rtol=0.03)


def test_features_within_their_thresholds_get_no_weight(case):
    fit = fitted(case, 500, 100.0, [3.0, -2.0])
    assert fit.converged
    np.testing.assert_array_equal(fit.reward_weights, 0)


def test_hoeffding_thresholds_shrink_with_the_root_of_the_episodes(case):
    few, many = (hoeffding_thresholds(case.problem, n) for n in (10, 1000))
    np.testing.assert_allclose(few / many, 10)
    short = hoeffding_thresholds(case.problem, 10, horizon=8.0)
    np.testing.assert_allclose(short / few, 1 - 0.9**8)
    spread = case.problem.features[..., 1].max() / (1 - 0.9)
    assert few[1] == pytest.approx(spread * np.sqrt(np.log(40) / 20))


def test_features_that_no_sample_reaches_are_said_and_weights_stay_finite(case):
    fit = fitted(case, 3, 0.0, largest_weight=40.0)
    assert not fit.converged
    assert fit.message == (
        "not converged: weights reached largest_weight along -1.00 reward brightness, +1.00 reward"
        " goal; take more samples"
    )
    ranges = feature_ranges(case.problem)
    assert np.max(np.abs(ranges * fit.reward_weights)) == pytest.approx(40.0, rel=1e-12)


def test_importance_weights_are_ratios_of_action_probabilities(case):
    samples, policy = uniform_samples(case, 5)
    skewed = np.tile([0.5, 0.2, 0.1, 0.1, 0.1], (16, 1))
    log_weights = importance_log_weights(case.problem, samples, policy, skewed)
    for episode in range(5):
        actions = samples.action[samples.episode == episode]
        expected = np.prod(skewed[0][actions] / 0.2)
        assert np.exp(log_weights[episode]) == pytest.approx(expected)


def test_only_demonstrations_are_enough_with_samples_from_estimates(case):
    samples, policy = sample_from_estimates(
        case.problem, case.decisions, n_episodes=500, n_steps=8, rng=np.random.default_rng(2)
    )
    fit = fit_relative_entropy_irl(
        case.problem,
        case.decisions,
        samples=samples,
        sampling_policy=policy,
        rng=np.random.default_rng(3),
        thresholds=np.full(2, 0.05),
    )
    assert fit.converged
    assert np.all(np.isfinite(fit.reward_weights))


def test_thresholds_cover_the_counts_of_episodes_of_any_of_their_lengths(case):
    """With gamma 0.9 a feature of 1 counts 1, 1.9, 2.71, ... and 10 for ever."""
    constant = replace(case.problem, features=np.ones_like(case.problem.features))
    wide = np.sqrt(np.log(2.0 / 0.05) / 20.0)
    assert hoeffding_thresholds(constant, 10, horizon=3.0) == pytest.approx(0.0)
    assert hoeffding_thresholds(constant, 10, horizon=3.0, shortest=1.0) == pytest.approx(
        1.71 * wide
    )
    assert hoeffding_thresholds(constant, 10, shortest=2.0) == pytest.approx(8.1 * wide)


def test_a_fit_takes_its_thresholds_from_the_lengths_and_ends_of_its_episodes():
    grid = Grid(origin_m=(0, 0), cell_size_m=1.0, walkable=np.ones((3, 1), bool))
    problem = build_navigation_problem(
        grid=grid, flow=np.ones(3, int), goal_states=[2], wall_distance_m=np.ones(3), discount=0.9
    )
    steps = np.array([0, 1, 0, 1])
    absorbed = Decisions([0, 0, 1, 1], steps * 1.0, steps, np.ones(4, int), steps + 1)
    policy = problem.mdp.available / problem.mdp.available.sum(axis=1, keepdims=True)
    common = {"sampling_policy": policy, "initial_weights": np.ones(3), "max_steps": 3}
    for decisions, horizon, shortest in (
        (absorbed, np.inf, np.inf),
        (absorbed.select([0, 1, 2]), np.inf, 1.0),
        (absorbed.select([0, 2]), 1.0, 1.0),
    ):
        given = hoeffding_thresholds(problem, 2, 0.95, horizon, shortest)
        fits = [
            fit_relative_entropy_irl(
                problem, decisions, samples=absorbed, thresholds=thresholds, **common
            )
            for thresholds in (None, given)
        ]
        assert fits[0].objective == fits[1].objective


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"sampling_policy": np.eye(5)[[0] * 16]}, "sampling_policy must be above 0 wherever"),
        ({"thresholds": np.array([0.0, -1.0])}, "thresholds must not be negative, got -1"),
        ({"largest_weight": -1.0}, "largest_weight must be above 0, got -1"),
        ({"largest_weight": np.nan}, "largest_weight must be above 0, got nan"),
        ({"next_state": 99}, r"samples\[0\] reaches state 99"),
        ({"rows": 0}, "samples must hold at least one decision"),
    ],
)
def test_wrong_arguments_are_refused_by_name(case, change, sentence):
    samples, policy = uniform_samples(case, 5)
    if "next_state" in change:
        samples = replace(samples, next_state=np.full(len(samples), change["next_state"]))
    if "rows" in change:
        samples = samples.select(np.arange(change["rows"]))
    given = {"sampling_policy": policy, "initial_weights": np.zeros(2)}
    given |= {key: value for key, value in change.items() if key not in ("next_state", "rows")}
    with pytest.raises(SerdError, match=sentence):
        fit_relative_entropy_irl(case.problem, case.decisions, samples=samples, **given)


def test_thresholds_of_no_episodes_or_without_confidence_are_refused(case):
    with pytest.raises(SerdError, match="confidence must be between 0 and 1, got 1"):
        hoeffding_thresholds(case.problem, 10, confidence=1.0)
    with pytest.raises(SerdError, match="n_episodes must be at least 1, got 0"):
        hoeffding_thresholds(case.problem, 0)
