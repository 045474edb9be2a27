"""Drives by a learned model without ROS: decisions, goals and models that change, giving up."""

from dataclasses import replace

import numpy as np
import pytest

from serd_app.navigation.navigator import (
    GiveUp,
    ProgressMonitor,
    arrival_row,
    plan_remarks,
    planned_navigator,
    prediction_of,
)
from serd_app.navigation.settings import DriveSettings, NavigationSettings
from serd_bag.errors import FileError
from serd_core.arrival.chain import ArrivalByState
from serd_core.grid.grid import Action
from serd_files.model_file import load_model
from serd_sim.errors import SimError
from serd_sim.scenario.scenario import load_scenario
from serd_sim.scenario.settings import Obstacle
from support.episodes import episode_result
from support.observations import observation_at
from tests.conftest import model_row

HALLWAY = load_scenario("hallway")


@pytest.fixture
def navigator_of(save_model_of):
    """Makes a navigator of a model file with the fields, by settings with the changes."""

    def make(fields=(), **changes):
        settings = DriveSettings(model=str(save_model_of(**dict(fields))), **changes)
        navigator = planned_navigator(settings)
        navigator.begin(0)
        return navigator

    return make


def decide(navigator, x_m, y_m, time_s=0.0):
    """The decision of a robot in the cell of a place."""
    state = navigator.strategy.problem.grid.state_at(x_m, y_m)
    return navigator.decide(observation_at(x_m, y_m, time_s=time_s), state)


def to_goal(navigator, x_m, y_m):
    navigator.want_goal(x_m, y_m)
    navigator.plan()


def test_another_goal_turns_the_robot_round_and_one_in_a_wall_is_refused(navigator_of):
    navigator = navigator_of()
    assert decide(navigator, 4.5, 9.5) == Action.NORTH
    before = navigator.strategy
    with pytest.raises(SimError, match="goal must be in a walkable cell"):
        navigator.want_goal(9.0, 3.0)
    assert navigator.strategy is before
    to_goal(navigator, 1.5, 2.5)
    assert decide(navigator, 4.5, 9.5, time_s=2.0) in (Action.WEST, Action.SOUTH)
    assert navigator.way_m(observation_at(4.5, 9.5))[-1].tolist() == [1.5, 2.5]


def test_another_model_changes_the_policy_and_an_unusable_or_equal_one_nothing(
    navigator_of, save_model_of
):
    navigator = navigator_of()
    lazy = save_model_of(name="lazy.yaml", reward_weights={"goal": -5.0, "social_norm": 1.0})
    navigator.want_model(load_model(lazy), str(lazy))
    navigator.plan()
    assert navigator.model == str(lazy)
    assert len(navigator.strategy.driven.learned_traps.states) > 100
    before = navigator.strategy
    navigator.want_model(load_model(save_model_of("corridor")), "elsewhere.yaml")
    with pytest.raises(FileError, match=r"elsewhere\.yaml: was made for another grid"):
        navigator.plan()
    navigator.keep_plan()
    navigator.plan()
    assert (navigator.strategy, navigator.model) == (before, str(lazy))
    navigator.want_model(load_model(lazy), "model of the learner")
    navigator.plan()
    assert (navigator.strategy, navigator.model) == (before, "model of the learner")


def test_off_the_grid_it_waits_and_expects_nothing(navigator_of):
    navigator, outside = navigator_of(), observation_at(9.0, 3.0)
    assert navigator.decide(outside, -1) == Action.WAIT
    assert navigator.forecast.probability == 0.0
    assert navigator.forecast.law.quantile_s(0.5) is None
    assert len(navigator.way_m(outside)) == 0
    assert prediction_of(navigator, outside) is None
    assert navigator.forecast.summary == "no arrival expected, before the time-out with 0%"
    assert navigator.forecast.needs_attention
    assert navigator.forecast.situation == "waiting: off the grid"


def test_a_robot_that_stands_still_gives_up_and_one_that_moves_on_or_has_a_new_goal_does_not(
    navigator_of,
):
    navigator, reasons = navigator_of(patience_decisions=3), []
    for step in range(4):
        decide(navigator, 4.5, 9.5, time_s=2.0 * step)
        reasons.append(navigator.gave_up)
    assert reasons == [None, None, None, GiveUp.NO_PROGRESS]
    navigator.begin(1)
    for step in range(6):
        decide(navigator, 4.5, 9.5 + step, time_s=2.0 * step)
        assert navigator.gave_up is None
    navigator.begin(2)
    for step in range(6):
        if step == 3:
            to_goal(navigator, 1.5, 2.5)
        decide(navigator, 4.5, 9.5, time_s=2.0 * step)
        assert navigator.gave_up is None


def test_the_remaining_time_grows_shorter_on_the_way_and_its_chances_fall_with_the_clock(
    navigator_of,
):
    navigator, medians, chances = navigator_of(timeout_s=120.0), [], []
    for step in range(8):
        decide(navigator, 4.5, 1.5 + step, time_s=2.0 * step)
        medians.append(navigator.forecast.law.quantile_s(0.5))
    assert (np.diff(medians) < 0).all()
    for step in range(8, 58):
        decide(navigator, 4.5, 8.5, time_s=2.0 * step)
        chances.append(navigator.forecast.probability)
    assert (np.diff(chances) <= 0).all()
    assert chances[0] > 0.9
    assert chances[-1] < 1e-6


def test_traps_are_counted_by_kind_and_reported_for_a_state(navigator_of):
    # One move in 100 succeeds: only the cells next to the goal are left before the time-out.
    forward = {"with_flow": 0.01, "against_flow": 0.01, "across_flow": 0.01, "waiting": 0.0}
    rows = tuple(model_row(name, (1 - p, p, 0.0, 0.0, 0.0)) for name, p in forward.items())
    navigator = navigator_of({"outcome_models": rows, "reward_weights": {"goal": 1.0}})
    traps, grid = navigator.strategy.traps, navigator.strategy.problem.grid
    words = plan_remarks(navigator.strategy)[-1]
    assert words.startswith(f"{len(traps.states)} of 176 cells are traps: from ")
    assert words.endswith(
        f"from {traps.unlikely.sum()} it is reached before the time-out with less than 50%"
    )
    for place, trapped in (((4.5, 1.5), True), ((10.5, 17.5), False)):
        assert (grid.state_at(*place) in traps) == trapped
        decide(navigator, *place)
        assert navigator.forecast.trapped == trapped
        assert navigator.forecast.needs_attention == trapped


def test_a_drive_is_compared_with_the_forecast_of_its_first_decision(navigator_of):
    navigator = navigator_of()
    assert plan_remarks(navigator.strategy) == []
    decide(navigator, 4.5, 9.5, 100.0)
    assert (navigator.forecast.by_time, navigator.forecast.situation) == (False, "driving")
    prediction = prediction_of(navigator, observation_at(4.5, 9.5, time_s=100.0))
    row = arrival_row(prediction, episode_result(4, "arrived", 40.0))
    law = navigator.forecast.law
    assert row.predicted_median_s == law.quantile_s(0.5)
    assert row.predicted_share == pytest.approx(float(law.probability_by(40.0)))
    assert (row.start_x_m, row.start_y_m, row.goal_x_m, row.goal_y_m) == (4.5, 9.5, 12.0, 18.0)
    late = arrival_row(prediction, episode_result(4, "aborted", reason="no progress"))
    assert np.isnan(late.predicted_share)


#: States 0, 1, 2 have a mean of 3, 2, 1 steps to go; the goal is state 3.
CDF = np.array([[0, 0, 0, 1], [0, 0, 1, 1], [0, 1, 1, 1], *[[1, 1, 1, 1]] * 2], dtype=np.float64)


@pytest.mark.parametrize(
    ("patience", "minimum", "left", "states", "last"),
    [
        (3, 0.0, 10, [0, 1, 0, 1], None),
        (3, 0.0, 10, [0, 1, 0, 1, 0], GiveUp.NO_PROGRESS),  # to and fro
        (0, 0.0, 10, [0] * 100, None),
        (2, 0.0, 10, [0, 0, 1, 1, 2, 2], None),
        (3, 0.9, 10, [0, -1, -1], None),  # off the grid
        (2, 0.9, 10, [0, -1, -1], GiveUp.NO_PROGRESS),
        (0, 0.5, 3, [0], None),
        (0, 0.5, 2, [0], GiveUp.UNLIKELY),
        (0, 0.5, -1, [0], GiveUp.UNLIKELY),
    ],
)
def test_every_new_minimum_of_the_expected_time_is_progress(patience, minimum, left, states, last):
    settings = NavigationSettings(patience_decisions=patience, minimum_arrival_probability=minimum)
    monitor, arrival = ProgressMonitor(settings), ArrivalByState(CDF, np.ones(4))
    reasons = [monitor.update(arrival, state, left) for state in states]
    assert reasons == [None] * (len(states) - 1) + [last]


def test_a_goal_that_walls_part_from_the_robot_is_refused_before_a_plan_is_made(navigator_of):
    navigator, south = navigator_of(), observation_at(3.5, 3.5)
    across = ((0.0, 10.0), (6.0, 10.0), (6.0, 12.0), (0.0, 12.0))
    fields = dict(HALLWAY) | {"obstacles": (Obstacle(name="wall", outline_m=across),)}
    parted = type(HALLWAY).model_construct(**fields)
    navigator.wanted = replace(navigator.wanted, scenario=parted)
    navigator.check_goal(1.5, 8.5, south)
    navigator.check_goal(1.5, 14.5, None)  # nobody knows yet where the robot is
    with pytest.raises(SimError, match=r"to which a way leads, got \(1.5, 14.5\) m, which walls"):
        navigator.check_goal(1.5, 14.5, south)
