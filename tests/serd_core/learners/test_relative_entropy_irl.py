import numpy as np
import pytest

import serd_core as sc
from serd_core.demonstrations.simulation import feature_counts
from serd_core.learners.relative_entropy_irl import hoeffding_thresholds, importance_log_weights
from serd_core.posterior.coordinates import feature_ranges
from support.small_problems import sampled

UNIFORM = np.full((16, 5), 0.2)


@pytest.fixture(scope="module")
def case(make_gridworld):
    return make_gridworld(side=4, n_episodes=60, n_steps=8)


def uniform_samples(case, n_episodes):
    return sampled(case.problem, UNIFORM, case.probabilities, n_episodes, 8)


def fitted(case, n_samples, threshold, weights=(0.0, 0.0), **options):
    given = {"samples": uniform_samples(case, n_samples), "sampling_policy": UNIFORM}
    given |= {"thresholds": np.full(2, threshold), "initial_weights": np.array(weights)}
    return sc.fit_relative_entropy_irl(case.problem, case.decisions, **given | options)


def test_with_exact_matching_the_weighted_samples_have_the_features_of_the_expert(case):
    fit = fitted(case, 3000, 0.0)
    assert fit.converged
    counts = feature_counts(case.problem, uniform_samples(case, 3000))
    share = np.exp(counts @ fit.reward_weights)
    wanted = feature_counts(case.problem, case.decisions).mean(axis=0)
    np.testing.assert_allclose(share @ counts / share.sum(), wanted, atol=1e-4)


def test_features_within_their_thresholds_get_no_weight(case):
    fit = fitted(case, 500, 100.0, [3.0, -2.0])
    assert fit.converged
    np.testing.assert_array_equal(fit.reward_weights, 0)


def test_features_that_no_sample_reaches_are_named_and_weights_stay_finite(case):
    fit = fitted(case, 3, 0.0, largest_weight=40.0)
    assert not fit.converged
    assert fit.message == (
        "not converged: weights reached largest_weight along -1.00 reward brightness, +1.00 reward"
        " goal; take more samples"
    )
    largest = np.max(np.abs(feature_ranges(case.problem) * fit.reward_weights))
    assert largest == pytest.approx(40.0, rel=1e-12)


def test_importance_weights_are_ratios_of_action_probabilities(case):
    samples, row = uniform_samples(case, 5), np.array([0.5, 0.2, 0.1, 0.1, 0.1])
    log_weights = importance_log_weights(case.problem, samples, np.tile(row, (16, 1)))
    for episode in range(5):
        expected = np.prod(0.2 / row[samples.action[samples.episode == episode]])
        assert np.exp(log_weights[episode]) == pytest.approx(expected)


def test_thresholds_are_hoeffdings(case):
    """With gamma 0.9 a feature of 1 counts 1, 1.9, 2.71, ... and 10 for ever."""
    few, many = (hoeffding_thresholds(case.problem, n) for n in (10, 1000))
    np.testing.assert_allclose(few / many, 10)
    short = hoeffding_thresholds(case.problem, 10, horizon=8.0)
    np.testing.assert_allclose(short / few, 1 - 0.9**8)
    spread = case.problem.features[..., 1].max() / (1 - 0.9)
    assert few[1] == pytest.approx(spread * np.sqrt(np.log(40) / 20))


def test_demonstrations_are_compared_with_samples_that_are_cut_off_at_the_same_time():
    rng = np.random.default_rng(1)
    moves = rng.dirichlet(np.full(12, 0.3), size=(12, 3))
    problem = sc.from_transitions(moves, rng.normal(size=(12, 3, 2)), discount=0.95)
    policy, rng = sc.soft_policy(problem, [1.0, -1.0]).probabilities, np.random.default_rng(2)
    decisions = sc.sample_decisions(problem.mdp, policy, n_episodes=600, n_steps=5, rng=rng)

    def of_steps(n_steps):
        made_by, rng = sc.clone_behaviour(problem, decisions), np.random.default_rng(0)
        samples = sc.sample_decisions(
            problem.mdp, made_by, n_episodes=4000, n_steps=n_steps, rng=rng
        )
        given = {"samples": samples, "sampling_policy": made_by, "thresholds": np.zeros(2)}
        start = np.zeros(2)
        fit = sc.fit_relative_entropy_irl(problem, decisions, initial_weights=start, **given)
        return fit.reward_weights

    np.testing.assert_allclose(of_steps(20), of_steps(5), atol=0.1)
    with pytest.raises(sc.SerdError, match=r"cut off after 5 decisions, got 3; sample 5 decisions"):
        of_steps(3)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"sampling_policy": np.eye(5)[[0] * 16]}, "sampling_policy must be above 0 wherever"),
        ({"samples": sc.Decisions([0], [0.0], [0], [0], [99])}, r"samples\[0\] reaches state 99"),
        ({"samples": sc.Decisions(*[[]] * 5)}, "samples must hold at least one decision"),
    ],
)
def test_wrong_arguments_are_refused_by_name(case, change, sentence):
    with pytest.raises(sc.SerdError, match=sentence):
        fitted(case, 5, 0.0, **change)
