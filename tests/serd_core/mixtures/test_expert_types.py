import numpy as np
import pytest

from serd_core.bayes.laplace import laplace
from serd_core.errors import SerdError
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mixtures.expert_types import choose_expert_types, drawn_partition, fit_expert_types


@pytest.fixture(scope="module")
def known(make_mixed):
    """Two types of experts who give four episodes each."""
    return make_mixed(experts=6, episodes=4, side=3)


@pytest.fixture(scope="module")
def chosen(known):
    return choose_expert_types(known.problem, known.decisions, experts=known.experts)


def same_parts(one, other):
    """Whether two partitions agree, whatever their labels."""
    return len(np.unique(np.stack([one, other]), axis=1).T) == len(set(one)) == len(set(other))


def test_two_of_two_types_are_recovered(known, chosen):
    assert chosen.converged
    assert chosen.n_types == 2
    assert same_parts(chosen.type_of_unit, known.types[::4])
    order = np.argsort(-chosen.reward_weights[:, 0])
    away = np.abs(chosen.reward_weights[order] - known.weights)
    assert np.all(away < 4 * chosen.reward_deviations[order])
    assert np.all(np.diff(chosen.shares) <= 0)
    np.testing.assert_allclose(chosen.shares.sum(), 1.0)
    np.testing.assert_array_equal(chosen.units, np.arange(12))
    assert chosen.n_episodes.sum() == pytest.approx(48.0)
    # Two weights for each type and one free share; 12 experts.
    assert chosen.bic == pytest.approx(chosen.log_likelihood - 5 / 2 * np.log(12))
    again = fit_expert_types(known.problem, known.decisions, 2, experts=known.experts)
    np.testing.assert_array_equal(again.reward_weights, chosen.reward_weights)


def test_types_need_enough_episodes_and_one_type_is_the_plain_fit(known, chosen):
    limits = {"most_types": 2, "minimum_episodes": 25.0}
    found = choose_expert_types(known.problem, known.decisions, experts=known.experts, **limits)
    assert found.n_types == 1
    assert found.bic < chosen.bic
    plain = fit_mdce_serd(known.problem, known.decisions)
    np.testing.assert_allclose(found.reward_weights[0], plain.reward_weights, rtol=1e-4)
    np.testing.assert_allclose(found.outcome_probabilities, plain.outcome_probabilities, atol=1e-5)
    covariance = laplace(known.problem, known.decisions, plain).covariance
    deviations = np.sqrt(np.diag(covariance))[: len(plain.reward_weights)]
    np.testing.assert_allclose(found.reward_deviations[0], deviations, rtol=1e-3)
    likelihood = plain.policy_log_likelihood + plain.dynamics_log_likelihood
    assert found.log_likelihood == pytest.approx(likelihood, abs=1e-2)


def test_units_far_apart_are_in_different_parts():
    points = np.repeat([[0.0, 0.0], [50.0, 0.0], [0.0, 50.0]], 4, axis=0)
    for seed in range(5):
        found = drawn_partition(points, 3, np.random.default_rng(seed))
        assert same_parts(found, np.repeat(np.arange(3), 4))
    same = drawn_partition(np.zeros((5, 2)), 2, np.random.default_rng(0))
    np.testing.assert_array_equal(same, np.zeros(5))


def test_bad_arguments_are_named(known):
    with pytest.raises(SerdError, match=r"n_types must be at most 48, the number of .*, got 49"):
        fit_expert_types(known.problem, known.decisions, 49)
    hidden = known.decisions.with_hidden_actions()
    with pytest.raises(SerdError, match=r"action\[0\] must be known for types of experts"):
        fit_expert_types(known.problem, hidden, 2)
    wrong = np.arange(len(known.decisions))
    with pytest.raises(SerdError, match="experts must be one per episode, got 0 and 1 in episode"):
        fit_expert_types(known.problem, known.decisions, 2, experts=wrong)
