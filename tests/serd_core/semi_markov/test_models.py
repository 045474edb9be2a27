from dataclasses import replace

import numpy as np
import pytest

import serd_core as sc
from support.refusals import refusals
from tests.support import semi_markov as rings


def differences(function, at, width=1e-4):
    columns = []
    for unit in np.eye(len(at)) * width:
        low, high = function(at - unit) - 0.0, function(at + unit)
        far = function(at + 2.0 * unit) - function(at - 2.0 * unit)
        columns.append((8.0 * (high - low) - far) / (12.0 * width))
    return np.array(columns)


@pytest.mark.parametrize(("laws", "paced"), rings.CASES)
def test_derivatives_of_the_table_are_those_of_differences(laws, paced):
    rng = np.random.default_rng(3)
    pace = rng.normal(0.0, 0.4, rings.PLACES) if paced else None
    timed, theta = rings.timed_ring(laws, pace)
    model = timed.mdp.transitions
    slope = rng.normal(size=model.local_probabilities(theta).shape)
    jacobian = differences(lambda at: model.local_probabilities(at).ravel(), theta).T
    np.testing.assert_allclose(model.local_jacobian(theta), jacobian, atol=1e-9)
    pulled = model.pull_back(theta, slope)
    np.testing.assert_allclose(pulled, jacobian.T @ slope.ravel(), atol=1e-8)
    curvature = differences(lambda at: model.pull_back(at, slope), theta)
    np.testing.assert_allclose(model.local_curvature(theta, slope), curvature, atol=1e-8)


def test_laws_of_rows_have_given_durations_where_nothing_moves_and_means_at_their_pace():
    pace = np.linspace(-0.5, 0.5, rings.PLACES)
    timed, truth = rings.timed_ring("and patience", pace)
    model = timed.mdp.transitions
    laws = model.laws(np.stack([truth, truth]))
    assert laws.mean_s.shape == (2, model.n_models, 3)
    of_against = (x[1, model.model_of[7, rings.AGAINST]] for x in laws)
    probability, mean_s, shape = of_against
    np.testing.assert_allclose(probability, rings.OUTCOMES[rings.AGAINST])
    np.testing.assert_allclose(mean_s, [3.0 * np.exp(pace[7]), 4.0, 4.0 * np.exp(pace[7])])
    np.testing.assert_allclose(shape, [5.0, np.inf, 5.0])
    np.testing.assert_allclose(laws.mean_s[0, model.model_of[3, rings.WAIT]][:2], 1.5)
    np.testing.assert_allclose(laws.mean_s[0, model.model_of[rings.GOAL, rings.WAIT]], 1.0)
    kernel = timed.mdp.discount * model.local_probabilities(truth)
    means = laws.mean_s[0]
    given = np.isinf(laws.shape[0])
    expected = laws.probability[0] * timed.mdp.discount**means
    np.testing.assert_allclose(kernel[given], expected[given], rtol=1e-13)
    assert np.all(kernel[~given] > expected[~given])


def test_dwell_times_that_are_all_equal_have_a_law_of_their_mean():
    timed, truth = rings.timed_ring()
    drawn = rings.demonstrations(timed, truth, np.random.default_rng(3), until_command_s=np.inf)
    equal = replace(drawn, dwell_s=np.full(len(drawn), 0.2))
    theta = sc.estimate_dynamics(timed, equal)
    assert np.exp(theta[timed.mdp.transitions.means])[0] == pytest.approx(0.2, rel=1e-3)
    assert sc.fit_mdce_serd(timed, equal).converged


TIMED, TRUTH = rings.timed_ring()
MODEL = TIMED.mdp.transitions
CHANCE = sc.Mdp(sc.fixed_transitions((2, 1), [0, 1], [0, 0], [1, 1], [1.0, 1.0]), 0.9)
SPARSE = sc.TabularProblem(CHANCE, np.zeros((2, 1, 1)), ("none",))
TOO_MUCH = np.full(MODEL.local_probabilities(TRUTH).shape, 0.4)
MIXED, GAP = [[0, 0, -1], [1, 1, 1], [2, 2, 2]], [[0, 0, 0], [2, 2, 2], [2, 2, 2]]


test_laws_that_do_not_fit_are_rejected = refusals(
    (lambda: sc.semi_markov_problem(rings.ring(), law_of=MIXED), "all outcomes of a model"),
    (lambda: sc.semi_markov_problem(rings.ring(), law_of=GAP), r"got \[0, 2\]; close gaps"),
    (
        lambda: sc.semi_markov_problem(rings.ring(), stay_s=[1, -1, 0]),
        r"stay_s\[1\] must not be neg",
    ),
    (
        lambda: sc.semi_markov_problem(rings.ring(), log_pace=np.zeros(3)),
        "log_pace must have shape",
    ),
    (lambda: sc.semi_markov_problem(SPARSE), "OutcomeModels"),
    (lambda: sc.Mdp(MODEL, 0.9), "discount of the Mdp must be that of its dwell times"),
    (
        lambda: sc.soft_policy(TIMED, rings.WEIGHTS, TOO_MUCH),
        "row 0 must not be negative and sum to",
    ),
    (lambda: MODEL.parameters_from(rings.OUTCOMES, [1, 0, 1], 2.0), r"mean_s\[1\] must be above 0"),
)
