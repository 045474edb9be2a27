"""Plans by a quantile over draws: closed forms, bounds and one draw."""

import numpy as np
import pytest

import serd_core as sc

DISCOUNT = 0.9


def fork():
    """A start with a known and an unknown way to a goal that lasts; who fails stays."""
    successors = np.array([[[1, 0], [1, 0]], [[1, 1], [1, 1]]])
    models = sc.OutcomeModels(successors, [[0, 1], [0, 1]], np.ones((2, 2), bool), 2)
    features = np.zeros((2, 2, 1))
    features[1] = 1.0
    return sc.TabularProblem(sc.Mdp(models, DISCOUNT), features, ("goal",))


def draws_of(unknown, known=0.5):
    table = np.stack([np.full_like(unknown, known), unknown], axis=1)
    return np.stack([table, 1.0 - table], axis=2)


@pytest.mark.parametrize(
    ("quantile", "arrives"), [(0.1, 0.5), (0.45, 0.5), (0.7, 0.7), (0.95, 1.0)]
)
def test_the_value_of_a_fork_is_that_of_the_better_way_at_the_quantile(quantile, arrives):
    """Ten draws 0.1, 0.2, ..., 1.0 of the unknown way; their mean is 0.55, above the known way."""
    tables = draws_of(np.arange(1, 11) / 10)
    found = sc.pessimistic_policy(fork(), [1.0], tables, quantile)
    goal = 1.0 / (1.0 - DISCOUNT)
    expected = DISCOUNT * arrives * goal / (1.0 - DISCOUNT * (1.0 - arrives))
    assert found.value == pytest.approx([expected, goal], rel=1e-7)
    assert found.greedy[0] == (arrives > 0.5)
    assert sc.optimal_policy(fork(), [1.0], tables.mean(axis=0)).greedy[0] == 1
    assert found.error_bound < 1e-6


def test_one_draw_is_the_optimal_policy_and_more_pessimism_is_worth_less(gridworld):
    problem, rng = gridworld.problem, np.random.default_rng(0)
    models = problem.mdp.transitions
    tables = rng.dirichlet(np.ones(models.n_outcomes), size=(9, models.n_models))
    weights = rng.normal(size=len(problem.feature_names))
    best = sc.optimal_policy(problem, weights, tables[0])
    alone = sc.pessimistic_policy(problem, weights, tables[:1], 0.3)
    np.testing.assert_allclose(alone.value, best.value, atol=1e-6)
    np.testing.assert_allclose(alone.probabilities, best.probabilities)
    values = [sc.pessimistic_policy(problem, weights, tables, q).value for q in (0.05, 0.5, 0.95)]
    each = [sc.optimal_policy(problem, weights, table).value for table in tables]
    assert np.all(values[0] <= values[1] + 1e-9)
    assert np.all(values[1] <= values[2] + 1e-9)
    assert np.all(values[0] <= np.min(each, axis=0) + 1e-6)  # the least of each pair apart


KNOWN = sc.from_transitions(np.eye(3)[:, None].repeat(2, axis=1), np.eye(3), discount=0.9)
ONE = draws_of(np.array([0.5]))
REFUSED = (
    (KNOWN, np.zeros(3), np.zeros((2, 1, 1)), 0.1, "problem must have outcome models, of which"),
    (fork(), [1.0], ONE, 1.0, "quantile must be between 0 and 1, got 1.0; use 0.1"),
    (fork(), [1.0, 2.0], ONE, 0.1, r"reward_weights must have shape \(1\), got \(2,\)"),
    (fork(), [1.0], ONE[0], 0.1, "outcome_probabilities must have shape"),
)


@pytest.mark.parametrize(("problem", "weights", "tables", "quantile", "sentence"), REFUSED)
def test_wrong_arguments_are_refused(problem, weights, tables, quantile, sentence):
    with pytest.raises(sc.SerdError, match=sentence):
        sc.pessimistic_policy(problem, weights, tables, quantile)
