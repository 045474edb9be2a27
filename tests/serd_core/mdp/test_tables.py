"""Problems from tables: all forms are one problem, and terminal states need no masking."""

import gymnasium
import numpy as np
import pytest

import serd_core as sc


def test_the_feature_of_a_terminal_state_counts_once():
    """One step to the end: Q = 0 + 0.5 * w for the step that arrives, whatever follows."""
    table = np.zeros((2, 1, 2))
    table[:, 0, 1] = 1.0
    for learned in (False, True):
        problem = sc.from_transitions(
            table, [[0.0], [1.0]], discount=0.5, terminal=[1], learned=learned
        )
        dynamics = np.ones(2) if learned else None
        np.testing.assert_allclose(sc.soft_policy(problem, [3.0], dynamics).value, [1.5, 3.0])
        assert problem.mdp.final.tolist() == [False, True]
        assert problem.mdp.transitions.n_parameters == 0


def test_an_environment_is_the_table_it_holds_and_its_reward():
    lake = gymnasium.make("FrozenLake-v1")
    problem = sc.from_gymnasium(lake, discount=0.9)
    assert np.flatnonzero(problem.mdp.final).tolist() == [5, 7, 11, 12, 15]
    assert problem.feature_names == ("reward",)
    # Down from 14 slips to the goal with a probability of 1/3.
    assert problem.features[14, 1, 0] == pytest.approx(1 / 3)
    optimal = sc.optimal_policy(problem, [1.0])
    # Value of the start at discount 0.9, as other solvers of this environment publish it.
    assert optimal.value[0] == pytest.approx(0.06889, abs=1e-5)


def test_the_reward_of_an_environment_is_its_expectation_under_the_name_that_is_given():
    outcomes = [(0.25, 1, 4.0, True), (0.75, 0, -1.0, False)]
    environment = type("Environment", (), {"P": {0: {0: outcomes}, 1: {0: []}}})()
    problem = sc.from_gymnasium(environment, discount=0.5, feature_names=["pay"])
    assert problem.feature_names == ("pay",)
    np.testing.assert_allclose(problem.features[:, 0, 0], [0.25, 0.0])


def test_rewards_of_moves_from_a_terminal_state_do_not_count():
    """Thirteen steps along the cliff cost 1 each; the table also has moves from the goal."""
    problem = sc.from_gymnasium(gymnasium.make("CliffWalking-v1"), discount=0.9)
    assert np.flatnonzero(problem.mdp.final).tolist() == [47]
    value = sc.optimal_policy(problem, [1.0]).value
    assert value[36] == pytest.approx(-(1 - 0.9**13) / 0.1, rel=1e-9)
    assert value[47] == 0.0


def test_outcome_models_of_an_environment_have_its_transitions():
    lake = gymnasium.make("FrozenLake-v1")
    features = np.random.default_rng(0).normal(size=(16, 4, 1))
    known = sc.from_gymnasium(lake, discount=0.9, features=features)
    learned = sc.from_gymnasium(lake, discount=0.9, features=features, model_of=0)
    np.testing.assert_allclose(
        sc.soft_policy(known, [2.0]).value,
        sc.soft_policy(learned, [2.0], np.full((1, 3), 1 / 3)).value,
        rtol=1e-12,
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"transitions": np.ones((2, 1, 3))}, r"must have shape \(states, actions, states\)"),
        ({"transitions": {"state": [0]}}, "transitions must be an array of numbers"),
        ({"transitions": np.full((2, 1, 2), 0.4)}, "but the row sums to 0.8; normalise that row"),
        ({"features": np.ones(3)}, r"features must have shape \(2, F\) or \(2, 1, F\), got \(3,\)"),
        ({"features": np.zeros((2, 0))}, "at least one feature, got none"),
        ({"terminal": [2]}, r"terminal\[0\] must be a state from 0 to 1, got 2"),
    ],
)
def test_wrong_tables_are_rejected_with_a_sentence(change, message):
    given = {"transitions": np.full((2, 1, 2), 0.5), "features": np.ones((2, 1)), "discount": 0.9}
    with pytest.raises(sc.SerdError, match=message):
        sc.from_transitions(**given | change)


END = (1.0, 0, 0.0, False)
LAKE = gymnasium.make("FrozenLake-v1")
KNOWN = {"features": np.ones((16, 1)), "discount": 0.9}


def environment(table):
    return type("Environment", (), {"P": table})()


@pytest.mark.parametrize(
    ("given", "options", "message"),
    [
        (object(), {}, "environment must have a table P"),
        (LAKE, {"features": None, "model_of": 0}, "features must be given where outcome models"),
        (LAKE, {"model_of": np.zeros((3, 3))}, "model_of must have shape"),
        (LAKE, {"model_of": "a"}, "model_of must be an array of numbers"),
        (environment({0: {0: [END], 2: [END]}, 1: {0: []}}), {}, r"keys of P\[0\] must be 0 to"),
        (environment({1: {0: [END]}}), {}, "keys of P must be 0 to "),
        (environment({0: {0: [END]}, "a": {}}), {}, "keys of P must be 0 to "),
        (environment({}), {}, r"P must list at least one outcome, got \{\}"),
        (environment({0: {0: []}}), {}, "P must list at least one outcome"),
        (environment([[[END]]]), {}, "P must be a dictionary, got"),
        (environment({0: [[END]]}), {}, r"P\[0\] must be a dictionary, got"),
        (
            environment({0: {0: [END[:3]]}}),
            {},
            r"P\[0\]\[0\] must list outcomes \(probability, next",
        ),
        (environment({0: {0: [("1", *END[1:])]}}), {}, r"P\[0\]\[0\] must list outcomes"),
        (environment({0: {0: [(1.0, 0.5, 0.0, False)]}}), {}, r"P\[0\]\[0\] must list outcomes"),
    ],
)
def test_tables_of_another_form_than_gymnasium_s_are_rejected(given, options, message):
    with pytest.raises(sc.SerdError, match=message):
        sc.from_gymnasium(given, **KNOWN | options)
