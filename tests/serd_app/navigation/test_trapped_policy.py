"""A learned policy that does not arrive: what is driven instead, forecast and reported."""

import numpy as np
import pytest

from serd_app.navigation.navigator import plan_remarks, planned_navigator
from serd_app.navigation.settings import DriveSettings
from serd_core.arrival.chain import timed_arrival
from serd_files.grid_file import flow_picture
from serd_sim.drivers.strategy import STEP_S, load_strategy, start_distribution
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.local_planner import make_planner
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.world import HallwayWorld
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
QUIET = HALLWAY.with_pedestrian_count(0)
#: The best is to stay where walls are far.
SHUNS_WALLS = {"goal": 0.1, "inverse_wall_distance": -5.0}
#: What laps with long waits before them made of the social norm where no people walk.
WAITS = {"goal": 1.8, "social_norm": 7.1, "inverse_wall_distance": 0.0}


def navigator_of(model, people=None):
    return planned_navigator(DriveSettings(model=str(model), people=people))


def test_waits_before_each_lap_do_not_keep_the_robot_where_no_people_walk(save_model_of):
    grid = load_strategy(str(save_model_of()), QUIET, "optimal").problem.grid
    learned_without_flow = flow_picture(grid, np.full(grid.n_states, -1))
    for flow in ((), learned_without_flow):
        navigator = navigator_of(save_model_of(reward_weights=WAITS, flow=flow), people=0)
        assert not len(navigator.strategy.driven.learned_traps.states)
        assert plan_remarks(navigator.strategy) == [
            "the model's weight of social_norm is not used, as what it weighs is not known here, or"
            " was not where it was learned"
        ]
    with HallwayWorld(QUIET, seed=3) as world:
        record = run_episode(world, make_planner(QUIET), navigator, episode=0)
    assert record.outcome == "arrived"
    assert record.time_of_arrival_s < 90.0


def test_where_it_is_best_to_stay_the_way_of_least_time_is_planned(save_model_of):
    strategy = navigator_of(save_model_of(reward_weights=SHUNS_WALLS)).strategy
    n_trapped = len(strategy.driven.learned_traps.states)
    assert n_trapped > 100
    assert int(strategy.by_time.sum()) == n_trapped
    (remark,) = plan_remarks(strategy)
    assert remark.startswith(
        f"the learned policy does not arrive from {n_trapped} of 176 cells: from {n_trapped} its"
        " actions never lead to the goal"
    )
    assert remark.endswith(f"in {n_trapped} cells the way of least expected time is taken instead")


def test_what_is_forecast_is_the_arrival_of_what_is_driven(save_model_of):
    navigator = navigator_of(save_model_of(reward_weights=SHUNS_WALLS))
    strategy, policy = navigator.strategy, navigator.strategy.policy.probabilities
    navigator.begin(0)
    navigator.decide(observation_at(4.5, 1.5), strategy.problem.grid.state_at(4.5, 1.5))
    forecast = navigator.forecast
    chain = timed_arrival(strategy.problem, policy, strategy.draws[0], STEP_S, strategy.n_steps)
    assert np.array_equal(strategy.arrival.cdf, chain.cdf)
    assert forecast.probability == chain.cdf[-1][forecast.state]
    assert forecast.probability > 0.99
    assert (forecast.by_time, forecast.trapped) == (True, False)
    assert forecast.needs_attention
    assert forecast.summary.endswith("with 100%, by the way of least expected time")
    assert forecast.situation.startswith("driving the way of least expected time, as the learned")
    starts = start_distribution(HALLWAY, "train")
    assert strategy.law_from(starts).cdf[-1] == pytest.approx(chain.cdf[-1] @ starts)
