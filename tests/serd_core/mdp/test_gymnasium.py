"""Environments of Gymnasium as problems."""

import gymnasium
import numpy as np
import pytest

import serd_core as sc
from support.refusals import refusals

LAKE = gymnasium.make("FrozenLake-v1")


def environment(table):
    return type("Environment", (), {"P": table})()


def test_an_environment_is_the_table_it_holds_and_its_reward():
    problem = sc.from_gymnasium(LAKE, discount=0.9)
    assert np.flatnonzero(problem.mdp.final).tolist() == [5, 7, 11, 12, 15]
    assert problem.feature_names == ("reward",)
    # Down from 14 slips to the goal with a probability of 1/3.
    assert problem.features[14, 1, 0] == pytest.approx(1 / 3)
    optimal = sc.optimal_policy(problem, [1.0])
    # Value of the start at discount 0.9, as other solvers of this environment publish it.
    assert optimal.value[0] == pytest.approx(0.06889, abs=1e-5)


def test_the_reward_of_an_environment_is_its_expectation_under_the_name_that_is_given():
    outcomes = [(0.25, 1, 4.0, True), (0.75, 0, -1.0, False)]
    found = environment({0: {0: outcomes}, 1: {0: []}})
    problem = sc.from_gymnasium(found, discount=0.5, feature_names=["pay"])
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
    features = np.random.default_rng(0).normal(size=(16, 4, 1))
    known = sc.from_gymnasium(LAKE, discount=0.9, features=features)
    learned = sc.from_gymnasium(LAKE, discount=0.9, features=features, model_of=0)
    np.testing.assert_allclose(
        sc.soft_policy(known, [2.0]).value,
        sc.soft_policy(learned, [2.0], np.full((1, 3), 1 / 3)).value,
        rtol=1e-12,
    )


END = (1.0, 0, 0.0, False)
FEATURES = np.ones((16, 1))
LISTS = [], [END[:3]], [("1", *END[1:])], [(1.0, 0.5, 0.0, False)]
KEYS = {0: {0: [END], 2: [END]}, 1: {0: []}}, {1: {0: [END]}}, {0: {0: [END]}, "a": {}}, {}
WRONG = [*KEYS, *({0: {0: listed}} for listed in LISTS)]


LEFT = environment({0: {0: [(1.0, 1, 0.0, True)]}})
UNEVEN = environment({0: {0: [END] * 3, 1: [END] * 2}})


def problem_of(given, features=FEATURES, **options):
    return lambda: sc.from_gymnasium(given, discount=0.9, features=features, **options)


test_tables_of_another_form_than_gymnasium_s_are_rejected = refusals(
    (problem_of(object()), "environment must have a table P"),
    (problem_of(LAKE, None, model_of=0), "features must be an array of numbers"),
    (problem_of(LAKE, model_of=np.zeros((3, 3))), "model_of must have shape"),
    (problem_of(LAKE, model_of="a"), "model_of must be an array of numbers"),
    *[(problem_of(environment(table)), "must have a table P, as FrozenLake") for table in WRONG],
    (problem_of(LEFT), r"next_state\[0\] must be a state"),
    (problem_of(UNEVEN, FEATURES[:1], model_of=0), r"successors\[0, 1, 2\] must be .* 0, got -1"),
)
