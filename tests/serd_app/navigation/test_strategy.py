"""Strategies of model files: cells ahead, models of other places, draws of a posterior."""

import numpy as np
import pytest

from serd_app.navigation.navigator import Navigator
from serd_app.navigation.settings import NavigationSettings
from serd_app.navigation.strategy import load_strategy, start_distribution
from serd_bag.errors import FileError
from serd_core.grid.grid import Action
from serd_core.policies.solved_policy import soft_policy
from serd_files.model_file import GridSummary, ModelDraws, OutcomeModel, load_model
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.scenario import load_scenario
from support.observations import observation_at

HALLWAY = load_scenario("hallway")


@pytest.fixture
def strategy(save_model_of):
    return load_strategy(str(save_model_of()), HALLWAY, "optimal")


def test_one_cell_ahead_is_the_next_cell_from_everywhere(strategy):
    for state, action in enumerate(strategy.policy.greedy):
        ahead = strategy.cell_ahead(state, Action(int(action)), 1)
        assert ahead == strategy.problem.grid.neighbours[state, action]


def test_the_likeliest_next_cell_is_that_of_the_largest_summed_outcome(strategy):
    """Against a sum over all outcomes by hand."""
    problem, table = strategy.problem, strategy.outcome_probabilities
    models = problem.outcome_models
    for state, found in enumerate(strategy.likeliest_next):
        action = int(strategy.policy.greedy[state])
        chances = np.zeros(problem.mdp.n_states)
        row = table[models.model_of[state, action]]
        np.add.at(chances, models.successors[state, action], row)
        chances[state] = 0.0
        if chances.any():
            assert chances[found] == pytest.approx(chances.max())
        else:
            assert found == state


def test_farther_ahead_goes_straight_on_and_stops_before_a_turn_and_at_the_goal(strategy):
    grid = strategy.problem.grid
    goals = set(strategy.problem.goal_states.tolist())
    farther = 0
    for state in range(grid.n_states):
        action = Action(int(strategy.policy.greedy[state]))
        ahead = strategy.cell_ahead(state, action, 3)
        step = grid.cells[ahead] - grid.cells[state]
        assert np.count_nonzero(step) <= 1
        assert np.abs(step).sum() <= 3
        path = [state]
        while path[-1] != ahead:
            path.append(int(grid.neighbours[path[-1], action]))
        assert not goals & set(path[:-1]) or state in goals
        assert all(strategy.policy.greedy[cell] == action for cell in path[1:-1])
        farther += len(path) == 4
    assert farther > grid.n_states / 3


def test_the_navigator_sends_the_robot_as_far_ahead_as_it_is_told(save_model_of):
    path = save_model_of()
    centre = {}
    for cells in (1, 2, 3):
        settings = NavigationSettings(model=str(path), lookahead_cells=cells)
        navigator = Navigator(HALLWAY, settings)
        navigator.begin(0)
        observation = observation_at(4.5, 5.5)
        action = navigator.decide(observation)
        assert action == Action.NORTH
        centre[cells] = navigator.waypoint_of(observation, action)
    assert [(each.x_m, each.y_m) for each in centre.values()] == [
        (4.5, 6.5),
        (4.5, 7.5),
        (4.5, 8.5),
    ]


def test_a_model_of_another_place_is_refused_unless_transfer_is_wanted(save_model_of):
    path = str(save_model_of("corridor"))
    with pytest.raises(FileError, match="was made for another grid of the scenario 'corridor'"):
        load_strategy(path, HALLWAY, "optimal", transfer=False)
    assert load_strategy(path, HALLWAY, "optimal", transfer=True).transferred
    assert not load_strategy(path, load_scenario("corridor"), "optimal", transfer=True).transferred


@pytest.mark.parametrize("there", builtin_scenarios())
@pytest.mark.parametrize("here", builtin_scenarios())
def test_a_model_of_any_scenario_leads_to_the_goal_in_any_other(there, here, save_model_of):
    path = str(save_model_of(there))
    strategy = load_strategy(path, load_scenario(here), "optimal", transfer=True)
    assert strategy.transferred == (there != here)
    assert len(strategy.traps.states) == 0
    assert np.allclose(strategy.arrival.arrival_probability, 1.0)


def test_outcome_models_and_outcomes_are_found_by_name_whatever_their_order(save_model_of):
    usual = load_model(save_model_of())
    turned = tuple(
        OutcomeModel(
            name=each.name,
            learned=each.learned[::-1],
            believed=each.believed[::-1],
            initial=each.initial[::-1],
        )
        for each in usual.outcome_models[::-1]
    )
    path = save_model_of(
        name="turned.yaml", outcome_models=turned, outcome_names=usual.outcome_names[::-1]
    )
    found = load_strategy(str(path), HALLWAY, "optimal", transfer=False)
    assert np.array_equal(found.outcome_probabilities, usual.outcome_probabilities)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"reward_weights": {"goal": 1.0, "noise_level": 2.0}},
            "features must be among goal, social_norm, inverse_wall_distance, got 'noise_level'",
        ),
        ({"decision_period_s": 1.0}, "decision periods of 1 s, but 'hallway' has 2 s"),
        (
            {"outcome_names": ("stay", "forward", "right", "back", "spin")},
            "outcome_names must have stay, forward, right, back, left, but 'left' is missing",
        ),
    ],
)
def test_what_cannot_be_used_is_said_with_the_file(changes, sentence, save_model_of):
    path = save_model_of(**changes)
    with pytest.raises(FileError, match=f"{path.name}: .*{sentence}"):
        load_strategy(str(path), HALLWAY, "optimal", transfer=True)


def test_cells_of_another_size_are_refused(save_model_of):
    grid = load_model(save_model_of()).grid
    coarse = GridSummary(**{**grid.model_dump(), "cell_size_m": 2.0, "fingerprint": "other"})
    path = save_model_of(name="coarse.yaml", grid=coarse)
    with pytest.raises(FileError, match="learned with cells of 2 m, but 'hallway' has 1 m"):
        load_strategy(str(path), HALLWAY, "optimal", transfer=True)


@pytest.fixture
def tables(save_model_of):
    """Of two draws: one as the model, one in which everyone stays more often."""
    learned = load_model(save_model_of()).outcome_probabilities
    slow = 0.7 * learned + 0.3 * np.eye(5)[0]
    return np.array([learned, slow])


@pytest.fixture
def draws(tables):
    return ModelDraws(
        reward_weights=((5.0, 1.0, 0.0), (3.0, 0.5, -0.5)),
        learned=tuple(tuple(map(tuple, table)) for table in tables.tolist()),
    )


@pytest.mark.parametrize("kind", ["optimal", "soft"])
def test_arrival_is_averaged_over_the_draws_and_its_curve_by_each_is_known(
    kind, draws, tables, save_model_of
):
    found = load_strategy(str(save_model_of(draws=draws)), HALLWAY, kind)
    starts = start_distribution(HALLWAY, "train")
    arrival = found.predicted_arrival(starts, 60)
    one, other = arrival.cdf_draws
    assert np.allclose(arrival.cdf, (one + other) / 2)
    assert np.all(other <= one)
    assert np.max(one - other) > 0.2
    by_state = found.arrival
    n = min(60, by_state.n_periods)
    assert by_state.cdf[: n + 1] @ starts == pytest.approx(arrival.cdf[: n + 1], abs=1e-9)
    law = found.law_s(arrival)
    assert law.cdf == pytest.approx(law.cdf_draws.mean(axis=0))
    alone = load_strategy(str(save_model_of(name="alone.yaml")), HALLWAY, "optimal")
    if kind == "optimal":
        assert alone.predicted_arrival(starts, 60).cdf == pytest.approx(one)
        assert np.array_equal(found.policy.probabilities, alone.policy.probabilities)
    assert np.array_equal(found.outcome_draws, tables)


def test_the_soft_policy_is_the_average_over_the_draws(draws, tables, save_model_of):
    found = load_strategy(str(save_model_of(draws=draws)), HALLWAY, "soft")
    each = [
        soft_policy(found.problem, np.array(weights), table).probabilities
        for weights, table in zip(draws.reward_weights, tables, strict=True)
    ]
    assert found.policy.probabilities == pytest.approx((each[0] + each[1]) / 2)
    assert np.max(np.abs(each[0] - each[1])) > 0.05
