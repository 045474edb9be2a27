import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import Transitions
from support.refusals import refusals


def two_models(beta: float = 1.0) -> OutcomeModels:
    """Three states in a row, two actions, outcomes stay and move; the end blocks."""
    successors = np.array([[[0, 1], [0, 0]], [[1, 2], [1, 0]], [[2, 2], [2, 1]]])
    return OutcomeModels(successors, [[0, 1]] * 3, np.ones((3, 2), bool), n_models=2, beta=beta)


def test_probabilities_follow_the_gibbs_distribution_with_its_scale():
    probabilities = two_models(beta=2.0).local_probabilities(np.array([0.0, 1.0, 0.0, 0.0]))
    assert probabilities[0, 1] == pytest.approx(np.exp(2) / (1 + np.exp(2)))


def test_outcomes_that_land_in_the_same_cell_add_up():
    model = two_models()
    dense = Transitions(model, np.array([[0.3, 0.7], [0.4, 0.6]])).matrix.toarray()
    np.testing.assert_allclose(dense[4], [0, 0, 1])
    np.testing.assert_allclose(dense[2], [0, 0.3, 0.7])
    np.testing.assert_allclose(dense.sum(axis=1), 1)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_pulled_back_gradient_is_the_finite_difference(seed):
    rng = np.random.default_rng(seed)
    model, theta, weight = two_models(beta=1.7), rng.normal(size=4), rng.normal(size=6)

    def total(parameters):
        dense = Transitions(model, model.local_probabilities(parameters)).matrix
        return float(weight @ dense @ np.array([1.0, -2.0, 0.5]))

    entry_gradient = weight[model.row] * np.array([1.0, -2.0, 0.5])[model.successor]
    gradient = model.pull_back(theta, model.gather(entry_gradient))
    step = 1e-6
    numeric = [
        (total(theta + step * unit) - total(theta - step * unit)) / (2 * step) for unit in np.eye(4)
    ]
    np.testing.assert_allclose(gradient, numeric, atol=1e-8)


def test_unavailable_actions_have_no_entries_and_their_indices_do_not_matter():
    model = OutcomeModels(
        np.array([[[0], [99]]]), np.array([[0, 99]]), np.array([[True, False]]), n_models=1
    )
    np.testing.assert_array_equal(model.row_start, [0, 1, 1])
    np.testing.assert_array_equal(model.successor, [0])


def test_energies_and_probabilities_are_inverse_to_each_other():
    model, probabilities = two_models(beta=3.0), np.array([[0.2, 0.8], [0.9, 0.1]])
    energies = model.parameters_of(probabilities)
    np.testing.assert_allclose(model.local_probabilities(energies), probabilities)
    np.testing.assert_allclose(energies.reshape(2, 2).sum(axis=1), 0, atol=1e-15)
    certain = np.array([[0.0, 1.0], [0.3, 0.7]])
    energies = model.fixed_parameters_of(certain)
    np.testing.assert_allclose(model.local_probabilities(energies), certain, atol=0, rtol=1e-14)


ONE = {"successors": [[[0, 0]]], "model_of": [[0]], "available": np.ones((1, 1), bool)}


def one_state(**change):
    return lambda: OutcomeModels(**ONE | {"n_models": 1} | change)


def moves(table):
    return lambda: two_models().require_transitions(np.array(table))


def energies_of(second):
    return lambda: two_models().parameters_of(np.array([[0.5, 0.5], second]))


test_wrong_tables_and_rows_that_are_no_distribution_are_named = refusals(
    (one_state(successors=[[[0, 3]]]), r"successors\[0, 0, 1\] must be a state from 0 to 0, got 3"),
    (one_state(model_of=[[1]]), r"model_of\[0, 0\] must be a model from 0 to 0, got 1"),
    (one_state(n_models=1.5), "n_models must be a whole number of at least 1, got 1.5"),
    (moves([[0.3, 0.7], [0.5, 0.6]]), "state 0, action 1 .* row sums to 1.1"),
    (moves([[-0.3, 1.3], [0.5, 0.5]]), "state 0, action 0 .* entry of -0.3"),
    (moves([[1.0], [1.0]]), r"must have shape \(2, 2\) \(models, outcomes\)"),
    (energies_of([0.0, 1.0]), r"probabilities\[1, 0\] must be above 0"),
    (energies_of([0.5, 0.9]), r"s\[1\] must sum to 1, got 1.4; normalise"),
    (energies_of([1.5, -0.5]), r"s\[1, 1\] must be finite and not negative"),
)
