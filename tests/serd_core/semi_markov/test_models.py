from dataclasses import replace

import numpy as np
import pytest

import serd_core as sc
from serd_core.dynamics.transition_model import Transitions
from serd_core.policies.solved_policy import solution_at
from tests.support.semi_markov import (
    AGAINST,
    GOAL,
    LAWS,
    OUTCOMES,
    PLACES,
    WAIT,
    WEIGHTS,
    demonstrations,
    ring,
    timed_ring,
)


def differences(function, at, width=1e-4):
    columns = []
    for unit in np.eye(len(at)) * width:
        low, high = function(at - unit) - 0.0, function(at + unit)
        far = function(at + 2.0 * unit) - function(at - 2.0 * unit)
        columns.append((8.0 * (high - low) - far) / (12.0 * width))
    return np.array(columns)


@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize("paced", [False, True])
def test_derivatives_of_the_table_are_those_of_differences(laws, paced):
    rng = np.random.default_rng(3)
    pace = rng.normal(0.0, 0.4, PLACES) if paced else None
    timed, theta = timed_ring(laws, pace)
    model = timed.mdp.transitions
    slope = rng.normal(size=model.local_probabilities(theta).shape)
    jacobian = differences(lambda at: model.local_probabilities(at).ravel(), theta).T
    np.testing.assert_allclose(model.local_jacobian(theta), jacobian, atol=1e-9)
    pulled = model.pull_back(theta, slope)
    np.testing.assert_allclose(pulled, jacobian.T @ slope.ravel(), atol=1e-8)
    curvature = differences(lambda at: model.pull_back(at, slope), theta)
    np.testing.assert_allclose(model.local_curvature(theta, slope), curvature, atol=1e-8)


def test_values_are_those_of_the_equation_with_times_drawn():
    timed, truth = timed_ring()
    model, gamma = timed.mdp.transitions, timed.mdp.discount
    table = model.local_probabilities(truth)
    solution = solution_at(timed, WEIGHTS, Transitions(model, table))
    rng = np.random.default_rng(4)
    kernel = OUTCOMES.copy()
    for m, mean in enumerate((1.0, 3.0, 0.8)):
        kernel[m] *= np.mean(gamma ** rng.gamma(5.0, mean / 5.0, 400_000))
    outcomes = ring().mdp.transitions
    following = solution.value[outcomes.successors]
    expected = ring().features @ WEIGHTS + np.sum(kernel[outcomes.model_of] * following, axis=2)
    moving = np.arange(1, PLACES)
    np.testing.assert_allclose(solution.q[moving], expected[moving], rtol=5e-4)
    # In the goal, which nothing leaves, a decision takes one second.
    assert solution.value[0] == pytest.approx(WEIGHTS[0] / (1.0 - gamma))


def test_short_moves_keep_the_certificate_of_the_solution():
    timed, truth = timed_ring()
    model = timed.mdp.transitions
    fast = truth.copy()
    fast[model.means] = np.log(0.05)
    table = model.local_probabilities(fast)
    assert table.sum(axis=1).max() > 1.0
    found = sc.soft_policy(timed, WEIGHTS, table)
    again = sc.soft_policy(timed, WEIGHTS, table, solver=sc.Newton(accuracy=1e-6))
    assert found.converged
    assert np.abs(again.value - found.value).max() <= again.error_bound + found.error_bound


def test_a_pace_moves_the_means_of_its_states():
    pace = np.full(PLACES, np.log(2.0))
    timed, truth = timed_ring(log_pace=pace)
    slow, same = timed_ring()
    model = slow.mdp.transitions
    same[model.means] += np.log(2.0)
    paced = timed.mdp.transitions.entries(timed.mdp.transitions.local_probabilities(truth))
    plain = model.entries(model.local_probabilities(same))
    np.testing.assert_allclose(paced, plain, rtol=1e-14)
    back = sc.semi_markov_problem(timed)
    assert np.all(back.mdp.transitions.log_pace == 0.0)


def test_laws_of_rows_have_given_durations_where_nothing_moves_and_means_at_their_pace():
    pace = np.linspace(-0.5, 0.5, PLACES)
    timed, truth = timed_ring("and patience", pace)
    model = timed.mdp.transitions
    laws = model.laws(np.stack([truth, truth]))
    assert laws.mean_s.shape == (2, model.n_models, 3)
    of_against = (x[1, model.model_of[7, AGAINST]] for x in laws)
    probability, mean_s, shape = of_against
    np.testing.assert_allclose(probability, OUTCOMES[AGAINST])
    np.testing.assert_allclose(mean_s, [3.0 * np.exp(pace[7]), 4.0, 4.0 * np.exp(pace[7])])
    np.testing.assert_allclose(shape, [5.0, np.inf, 5.0])
    np.testing.assert_allclose(laws.mean_s[0, model.model_of[3, WAIT]][:2], 1.5)
    np.testing.assert_allclose(laws.mean_s[0, model.model_of[GOAL, WAIT]], 1.0)
    kernel = timed.mdp.discount * model.local_probabilities(truth)
    means = laws.mean_s[0]
    given = np.isinf(laws.shape[0])
    expected = laws.probability[0] * timed.mdp.discount**means
    np.testing.assert_allclose(kernel[given], expected[given], rtol=1e-13)
    assert np.all(kernel[~given] > expected[~given])


def test_without_laws_the_table_is_that_of_the_outcomes():
    plain = ring()
    timed = sc.semi_markov_problem(plain, law_of=np.full((3, 3), -1))
    theta = plain.mdp.transitions.parameters_of(OUTCOMES)
    table = timed.mdp.transitions.local_probabilities(theta)
    assert np.array_equal(table, plain.mdp.transitions.local_probabilities(theta))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"law_of": np.array([[0, 0, -1], [1, 1, 1], [2, 2, 2]])}, "all outcomes of a model"),
        ({"law_of": np.array([[0, 0, 0], [2, 2, 2], [2, 2, 2]])}, r"got \[0, 2\]; close gaps"),
        ({"stay_s": np.array([1.0, -1.0, 0.0])}, r"stay_s\[1\] must not be negative"),
        ({"log_pace": np.zeros(3)}, r"log_pace must have shape \(12\)"),
    ],
)
def test_laws_that_do_not_fit_are_rejected(change, message):
    with pytest.raises(sc.SerdError, match=message):
        sc.semi_markov_problem(ring(), **change)


def test_another_discount_and_other_models_are_rejected():
    timed, _ = timed_ring()
    with pytest.raises(sc.SerdError, match="discount of the Mdp must be that of its dwell times"):
        sc.Mdp(timed.mdp.transitions, 0.9)
    chance = sc.learned_transitions((2, 1), [0, 0, 1], [0, 0, 0], [0, 1, 1])
    sparse = sc.TabularProblem(sc.Mdp(chance, 0.9), np.zeros((2, 1, 1)), ("none",))
    with pytest.raises(sc.SerdError, match="OutcomeModels"):
        sc.semi_markov_problem(sparse)
    too_much = np.full(timed.mdp.transitions.local_probabilities(timed_ring()[1]).shape, 0.4)
    with pytest.raises(sc.SerdError, match="row 0 must not be negative and sum to less than"):
        sc.soft_policy(timed, WEIGHTS, too_much)
    with pytest.raises(sc.SerdError, match=r"mean_s\[1\] must be above 0"):
        timed.mdp.transitions.parameters_from(OUTCOMES, np.array([1.0, 0.0, 1.0]), 2.0)


def test_the_choice_cost_of_weight_one_takes_the_mean_over_choices():
    problem = sc.with_choice_cost(ring())
    found = sc.soft_policy(problem, np.append(WEIGHTS, 1.0), OUTCOMES)
    available = problem.mdp.available
    mean = np.log(np.where(available, np.exp(found.q), 0.0).sum(axis=1))
    # Q holds the cost of its own decision, so that the sum over choices is their mean.
    np.testing.assert_allclose(found.value, mean, rtol=1e-12)
    q = found.q + np.log(available.sum(axis=1))[:, None]
    mean = np.log(np.where(available, np.exp(q), 0.0).sum(axis=1) / available.sum(axis=1))
    np.testing.assert_allclose(found.value, mean, rtol=1e-12)
    assert problem.feature_names[-1] == "choice_cost"


@pytest.mark.parametrize("seconds", [0.2, 1.0, 30.0])
def test_dwell_times_that_are_all_equal_have_a_law_of_their_mean(seconds):
    timed, truth = timed_ring()
    drawn = demonstrations(timed, truth, np.random.default_rng(3), until_command_s=np.inf)
    equal = replace(drawn, dwell_s=np.full(len(drawn), seconds))
    theta = sc.estimate_dynamics(timed, equal)
    means = np.exp(theta[timed.mdp.transitions.means])
    assert means[0] == pytest.approx(seconds, rel=1e-3)
    assert sc.fit_mdce_serd(timed, equal).converged
