import numpy as np
import pytest

from serd_core.ascent.lbfgs import Lbfgs
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.sparse_model import SparseModel, fixed_transitions
from serd_core.dynamics.transition_model import transitions_at
from serd_core.errors import SerdError
from serd_core.learners.maxent_irl import fit_maxent_irl
from serd_core.learners.mdce_irl import fit_mdce_irl_by_entropy, fit_mdce_irl_by_likelihood
from serd_core.learners.policy_matching import fit_policy_matching
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem


def test_entries_in_any_order_give_the_same_matrix():
    state, action, following = np.array([1, 0, 0]), np.array([0, 1, 1]), np.array([1, 1, 0])
    model = fixed_transitions((2, 2), state, action, following, np.array([1.0, 0.25, 0.75]))
    dense = transitions_at(model, np.zeros(0)).matrix.toarray()
    np.testing.assert_allclose(dense, [[0, 0], [0.75, 0.25], [0, 1], [0, 0]])
    np.testing.assert_array_equal(model.available, [[False, True], [True, False]])
    np.testing.assert_array_equal(model.absorbing, [False, True])


def test_users_functions_may_write_into_their_arguments_and_reuse_an_array():
    result = np.zeros(2)

    def probabilities(parameters):
        result[:] = [parameters[0], 1.0 - parameters[0]]
        parameters[:] = 9.0
        return result

    def product(_, gradient):
        gradient -= gradient[1]
        return gradient[:1]

    model = SparseModel((2, 1), [0, 0], [0, 0], [0, 1], 1, probabilities, product)
    parameters, gradient = np.array([0.25]), np.array([3.0, 1.0])
    first = model.local_probabilities(parameters)
    model.local_probabilities(np.array([0.5]))
    np.testing.assert_array_equal(first, [0.25, 0.75])
    np.testing.assert_array_equal(model.pull_back(parameters, gradient), [2.0])
    np.testing.assert_array_equal(parameters, [0.25])
    np.testing.assert_array_equal(gradient, [3.0, 1.0])


def logistic_problem():
    """0 -> 1 with the logistic function of one parameter, else it stays; 1 stays."""

    def entries(theta):
        onward = 1.0 / (1.0 + np.exp(-theta[0]))
        return np.array([onward, 1.0 - onward, 1.0, 1.0])

    def vector_jacobian(theta, gradient):
        onward = 1.0 / (1.0 + np.exp(-theta[0]))
        return np.array([onward * (1.0 - onward) * (gradient[0] - gradient[1])])

    model = SparseModel(
        (2, 2), [0, 0, 0, 1], [0, 0, 1, 0], [1, 0, 0, 1], 1, entries, vector_jacobian
    )
    features = np.zeros((2, 2, 1))
    features[1] = 1.0
    return TabularProblem(Mdp(model, 0.9), features, ("goal",))


FITS = [
    fit_mdce_irl_by_likelihood,
    fit_mdce_irl_by_entropy,
    fit_maxent_irl,
    fit_policy_matching,
]
EACH_FIT = pytest.mark.parametrize("fit", FITS, ids=lambda fit: fit.__name__)


@EACH_FIT
def test_dynamics_are_the_models_parameters_for_every_learner_of_rewards(fit):
    problem, theta = logistic_problem(), np.array([0.4])
    rows = np.array([(0, 0, 1), (0, 1, 0), (0, 0, 0)])
    decisions = Decisions(np.arange(3), np.zeros(3), *rows.T)
    settings = {"initial_weights": np.zeros(1), "ascent": Lbfgs(max_steps=3)}
    found = fit(problem, decisions, dynamics=theta, **settings)
    expected = problem.mdp.transitions.local_probabilities(theta)
    np.testing.assert_array_equal(found.outcome_probabilities, expected)
    with pytest.raises(SerdError, match=r"must be its \(1,\) parameters, not its entries"):
        fit(problem, decisions, dynamics=expected, **settings)


NAN = SparseModel((1, 1), [0], [0], [0], 2, lambda _: np.ones(1), lambda *_: np.full(2, np.nan))
LONG = SparseModel((1, 1), [0], [0], [0], 2, lambda _: np.ones(3), lambda _, gradient: gradient)
PLACES = [0, 1], [0, 0], [0, 0]


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: LONG.local_probabilities(np.zeros(2)), r"return \(1,\) numbers, one per entry, g"),
        (lambda: LONG.pull_back(np.zeros(2), np.ones(1)), r"return \(2,\) numbers, one per param"),
        (lambda: LONG.parameters_of(np.ones((1, 5))), r"must be its \(2,\) parameters, not its en"),
        (lambda: NAN.pull_back(np.zeros(2), np.ones(1)), "finite numbers, got nan for parameter 0"),
        (lambda: fixed_transitions((2, 1), *PLACES, [1, 0.5]), "state 1, action 0 .* sums to 0.5"),
        (lambda: fixed_transitions((2, 1), *PLACES, [1.0]), r"probability must have shape \(2\)"),
        (lambda: fixed_transitions((0, 1), [], [], [], []), "n_pairs must be at least one state"),
        (lambda: fixed_transitions((2, 1), [0], [0], [2], [1]), r"next_state\[0\] must be a next"),
        (lambda: fixed_transitions(2, *PLACES, np.ones(2)), r"n_pairs must have shape \(2\), got"),
        (lambda: fixed_transitions((2.5, 1), *PLACES, np.ones(2)), r"n_pairs\[0\] must be a whole"),
        (lambda: SparseModel((1, 1), [0], [0], [0], 2.0, np.ones, np.ones), "parameter_count must"),
        (lambda: SparseModel((1, 1), [0], [0], [0], -1, np.ones, np.ones), "parameter_count must"),
    ],
)
def test_wrong_functions_and_columns_of_users_are_refused(call, sentence):
    with pytest.raises(SerdError, match=sentence):
        call()
