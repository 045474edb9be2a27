"""Arrivals predicted by the times in cells of drives."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from serd_app.navigation.navigator import Navigator
from serd_app.navigation.settings import NavigationSettings
from serd_app.navigation.strategy import load_strategy, start_distribution
from serd_core.grid.grid import Action
from serd_files.model_file import CrossingTimes, load_model
from serd_sim.scenario.scenario import load_scenario
from tests.support.observations import observation_at

HALLWAY = load_scenario("hallway")
#: A second per cell and half of one from the centre of the first, without spread, only forward.
STEADY = CrossingTimes(
    lookahead_cells=3,
    coefficients={
        "intercept": 0.0, "against_flow": 0.0, "across_flow": 0.0, "turning": 0.0,
        "first": -np.log(2.0), "people_pm2": 2.0,
    },
    dispersion={"straight": 1e-4, "turning": 1e-4, "first": 1e-4},
    pace_variance=1e-6,
    people_pm2=(0.1, 0.2),
    mean_people_pm2=24 / 176,
    left_towards={
        "with_flow": (10**6, 0, 0, 0), "against_flow": (10**6, 0, 0, 0),
        "across_flow": (10**6, 0, 0, 0),
    },
    n_crossings=1000,
    n_episodes=50,
)  # fmt: skip


def moments_s(law):
    """Mean and standard deviation."""
    mass = np.diff(law.cdf, prepend=0.0)
    mean = mass @ law.times_s
    return mean, np.sqrt(mass @ (law.times_s - mean) ** 2)


@pytest.fixture
def strategy_of(save_model_of):
    def load(lookahead_cells=3, people=24, **changes):
        path = save_model_of(crossing_times=(STEADY.model_copy(update=changes),))
        place = HALLWAY.with_pedestrian_count(people)
        return load_strategy(
            str(path), place, "optimal", lookahead_cells=lookahead_cells, timeout_s=120.0
        )

    return load


def test_a_steady_robot_arrives_after_a_second_per_cell(strategy_of):
    found = strategy_of()
    state = found.problem.grid.state_at(0.5, 0.5)
    n_moves = len(found.intended_path_m(state)) - 1
    law = found.law_from(np.eye(found.problem.grid.n_states)[state])
    assert law.quantile_s(0.5) == pytest.approx(n_moves - 0.5, abs=0.4)
    assert law.quantile_s(0.95) - law.quantile_s(0.05) < 1.5
    assert law.arrival_probability == pytest.approx(1.0)
    assert found.arrival.cdf[-1, state] == pytest.approx(1.0)


def test_more_people_take_longer_and_are_called_an_extrapolation(strategy_of):
    few, many = strategy_of(), strategy_of(people=84)
    start = start_distribution(HALLWAY, "train")
    ratio = many.law_from(start).quantile_s(0.5) / few.law_from(start).quantile_s(0.5)
    assert ratio == pytest.approx(np.exp(2.0 * 60 / 176), rel=0.03)
    assert many.crossings.extrapolates
    assert not few.crossings.extrapolates


def test_the_spread_of_drives_widens_the_law(strategy_of):
    start = start_distribution(HALLWAY, "train")
    narrow, wide = (
        strategy_of(pace_variance=variance).law_from(start) for variance in (1e-6, 0.04)
    )
    spread = [np.log(law.quantile_s(0.95) / law.quantile_s(0.05)) for law in (narrow, wide)]
    assert spread[1] > spread[0] + 0.4


def test_draws_and_few_drives_spread_the_law_of_an_episode(strategy_of):
    start = start_distribution(HALLWAY, "train")
    few, many = (strategy_of(pace_variance=0.02, n_episodes=n).law_from(start) for n in (4, 10**6))
    middle = int(np.searchsorted(few.cdf, 0.5))
    spread = [np.ptp(law.cdf_draws[:, middle]) for law in (few, many)]
    assert spread[0] > 0.5
    assert spread[1] < 0.01
    assert few.cdf == pytest.approx(few.cdf_draws.mean(axis=0))
    # Of the same times as a pace of variance sigma^2 (1 + 1/n).
    place = strategy_of(pace_variance=0.02, n_episodes=4).crossings
    state = place.problem.grid.state_at(4.5, 2.5)
    one = np.eye(place.problem.grid.n_states)[state]
    here = place.from_pose(state, Action.WAIT, *place.problem.grid.centers_m[state])
    at_start = place.from_start(one)
    assert moments_s(at_start) == pytest.approx(moments_s(here), rel=0.01)


def test_each_draw_of_outcomes_goes_its_own_way(strategy_of):
    found = strategy_of(left_towards=dict.fromkeys(STEADY.left_towards, (0, 0, 0, 0)))
    tables = np.repeat(found.outcome_draws[:1], 2, axis=0)
    tables[1, :, [1, 2]] = tables[1, :, [2, 1]]  # to the right where the first goes ahead
    start = start_distribution(HALLWAY, "train")
    two = replace(found, outcome_draws=tables).law_from(start)
    alone = replace(found, outcome_draws=tables[:1]).law_from(start)
    assert np.abs(two.cdf_draws[::2] - alone.cdf_draws[::2]).max() < 1e-5
    assert two.quantile_s(0.5) > alone.quantile_s(0.5) + 1.0


def test_other_look_aheads_are_predicted_by_decision_periods(strategy_of, save_model_of):
    start = start_distribution(HALLWAY, "train")
    plain = load_strategy(
        str(save_model_of(name="plain.yaml")), HALLWAY, "optimal", timeout_s=120.0
    )
    found = strategy_of(lookahead_cells=1)
    assert found.times is None
    assert np.array_equal(found.law_from(start).cdf, plain.law_from(start).cdf)


def test_a_robot_that_is_farther_in_its_cell_arrives_earlier(strategy_of):
    found = strategy_of().crossings
    state = found.problem.grid.state_at(4.5, 8.5)
    medians = [
        found.from_pose(state, Action.NORTH, 4.5, 8.5 + ahead).quantile_s(0.5)
        for ahead in (-0.4, 0.0, 0.4)
    ]
    assert np.diff(medians) == pytest.approx([-0.4, -0.4], abs=0.21)


def test_a_navigator_forecasts_by_crossings_on_its_way(save_model_of):
    path = str(save_model_of(crossing_times=(STEADY,)))
    navigator = Navigator(HALLWAY, NavigationSettings(model=path, lookahead_cells=3))
    navigator.begin(0)
    medians = []
    for step, y_m in enumerate((2.5, 4.5, 6.5, 8.5)):
        navigator.decide(observation_at(4.5, y_m, time_s=2.0 * step))
        medians.append(navigator.forecast.law.quantile_s(0.5))
        assert navigator.forecast.probability == pytest.approx(1.0)
        assert navigator.forecast.periods_without_progress == 0
    assert np.diff(medians) == pytest.approx([-2.0] * 3, abs=0.41)


def test_crossing_times_are_in_the_file_only_where_there_are_some(save_model_of):
    with_times, plain = save_model_of(crossing_times=(STEADY,)), save_model_of(name="plain.yaml")
    assert load_model(with_times).crossing_times == (STEADY,)
    assert "crossing_times" not in plain.read_text()
    with pytest.raises(ValidationError, match="must have each lookahead_cells once, got"):
        save_model_of(crossing_times=(STEADY, STEADY))


def test_the_forecast_at_the_start_is_that_of_the_episode(strategy_of):
    steady = {**STEADY.coefficients, "first": 1.0}
    found = strategy_of(coefficients=steady).crossings
    grid = found.problem.grid
    state = grid.state_at(4.5, 2.5)
    at_start = found.from_start(np.eye(grid.n_states)[state])
    here = found.from_pose(state, Action.WAIT, *grid.centers_m[state])
    np.testing.assert_allclose(here.cdf, at_start.cdf, atol=0.002)  # two sums over paces
    assert here.quantile_s(0.5) > found.from_pose(state, Action.WAIT, 4.5, 2.9).quantile_s(0.5)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"dispersion": {"straight": 0.1}}, "dispersion must have straight, turning, first, got"),
        ({"coefficients": {"intercept": 0.0}}, "coefficients must have intercept, against_flow"),
        ({"left_towards": {}}, "left_towards must have with_flow, against_flow, across_flow, got"),
        ({"people_pm2": (0.2, 0.1)}, "people_pm2 must ascend from at least 0, got"),
    ],
)
def test_a_law_with_something_missing_is_rejected(change, sentence):
    with pytest.raises(ValidationError, match=sentence):
        CrossingTimes.model_validate({**STEADY.model_dump(), **change})
