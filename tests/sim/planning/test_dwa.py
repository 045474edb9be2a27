"""The dynamic window and the rollouts, against closed forms and the limited unicycle."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_sim.planning.dwa import (
    before_stop,
    reachable_window,
    roll_out,
    speed_to_stop_within,
)
from serd_sim.planning.local_planner import make_planner
from serd_sim.planning.rollout_costs import (
    CostSettings,
    RolloutCosts,
    predict_nearby,
)
from serd_sim.safety.motion import compose, out_of_frame
from serd_sim.scenario.occupancy import wall_distance_raster
from serd_sim.scenario.scenario import load_scenario
from serd_sim.scenario.settings import RobotSettings
from serd_sim.world.command import limited_velocity
from serd_sim.world.waypoint import Waypoint
from support.observations import observation_at

ROBOT = RobotSettings()
SLOW = RobotSettings(acc_lim_x_mps2=2.0, acc_lim_theta_radps2=4.0)
POSE = (1.0, 2.0, 0.3)
TIME_S = 0.05 * np.arange(1, 21)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_window_holds_what_the_accelerations_allow_up_to_the_limits_of_the_robot(sign):
    speeds, turns = reachable_window(ROBOT, 0.5, sign * 1.0, 0.1)
    assert speeds == pytest.approx((0.25, 0.75))
    assert turns == pytest.approx((sign - 1.2, sign + 1.2))
    speeds, turns = reachable_window(ROBOT, sign * 0.5, sign * 3.0, 10.0)
    assert speeds == (ROBOT.min_vel_x_mps, ROBOT.max_vel_x_mps)
    assert turns == (-ROBOT.max_vel_theta_radps, ROBOT.max_vel_theta_radps)


@pytest.mark.parametrize("start_s", [0.0, 0.25])
def test_straight_rollouts_cover_the_distance_of_constant_acceleration(start_s):
    """From 0.2 m/s to 1 m/s at 2 m/s2; the ramp ends with a step, so midpoints are exact."""
    rollouts = roll_out(
        POSE, (0.2, np.array([1.0, 0.2])), (0.0, np.zeros(1)), SLOW, TIME_S, 2.0, start_s
    )
    ramp_s = np.clip(TIME_S - start_s, 0.0, 0.4)
    after_s = np.maximum(TIME_S - start_s - 0.4, 0.0)
    way_m = 0.2 * np.minimum(TIME_S, start_s) + 0.2 * ramp_s + ramp_s**2 + 1.0 * after_s
    for index, expected_m in enumerate([way_m, 0.2 * TIME_S]):
        np.testing.assert_allclose(rollouts.x_m[index, 0], 1.0 + expected_m * math.cos(0.3))
        np.testing.assert_allclose(rollouts.y_m[index, 0], 2.0 + expected_m * math.sin(0.3))
    np.testing.assert_allclose(rollouts.yaw_rad, np.full((1, 20), 0.3))


def test_the_yaw_is_that_of_constant_acceleration_up_to_the_turn_time_and_constant_then():
    """From 0 to 1.2 rad/s at 4 rad/s2 within 0.3 s; it turns for 0.5 s, then drives straight."""
    rollouts = roll_out(POSE, (0.0, np.zeros(1)), (0.0, np.array([1.2, -1.2])), SLOW, TIME_S, 0.5)
    turning_s = np.minimum(TIME_S, 0.5)
    ramp_s = np.minimum(turning_s, 0.3)
    turned_rad = 2.0 * ramp_s**2 + 1.2 * (turning_s - ramp_s)
    np.testing.assert_allclose(rollouts.yaw_rad, [0.3 + turned_rad, 0.3 - turned_rad])
    # The turn lasts up to a midpoint that is the turn time.
    time_s = np.array([0.5, 1.0, 1.5])
    rollouts = roll_out(POSE, (0.0, np.zeros(1)), (1.0, np.ones(1)), SLOW, time_s, turn_time_s=0.75)
    np.testing.assert_allclose(rollouts.yaw_rad[0], 0.3 + np.array([0.5, 1.0, 1.0]))


STOPPING = RobotSettings(acc_lim_x_mps2=2.0, max_vel_x_mps=1.0)
TENTHS_S = np.arange(1, 11) / 10.0


def test_the_planner_is_no_faster_than_it_can_stop_at_the_waypoint():
    """v^2 = 2 * 0.7 a d; samples are even shares of that speed."""
    for distance_m in (0.01, 4.0):
        speed_mps = speed_to_stop_within(distance_m, STOPPING)
        assert speed_mps**2 / (2 * 0.7 * STOPPING.acc_lim_x_mps2) == pytest.approx(distance_m)
    hallway = load_scenario("hallway").with_pedestrian_count(0)
    limit_mps = speed_to_stop_within(0.12, hallway.robot)
    ahead = Waypoint(3.12, 8.0)
    sampled = make_planner(hallway).step(observation_at(3.0, 8.0), ahead).linear_mps
    assert sampled == pytest.approx(limit_mps / (hallway.local_planner.vx_samples - 2))


def test_only_the_times_before_the_robot_has_stopped_are_given():
    """From 1 m/s at 2 m/s2 it stops in 0.5 s, after 0.3 s of reaction; slow robots stand."""
    before = before_stop(np.array([1.0, 0.4, -0.4, 0.01]), STOPPING, TENTHS_S, slowest_mps=0.02)
    assert before.shape == (4, 8)
    assert before.sum(axis=1).tolist() == [8, 5, 5, 0]
    at_once = before_stop(np.array([1.0]), STOPPING, TENTHS_S, slowest_mps=0.0, reaction_s=0.0)
    assert at_once.shape[1] == 5
    assert before_stop(np.array([0.0]), STOPPING, TENTHS_S, slowest_mps=0.0).shape == (1, 0)


COSTS_S = np.array([0.5, 1.0])
SETTINGS = CostSettings()
COSTS = RolloutCosts(load_scenario("hallway"), COSTS_S)


def seen(people=(), velocity=None):
    return observation_at(2.0, 8.0, people=people, velocity=velocity)


def test_progress_is_the_mean_smallest_distance_so_far_plus_a_share_of_the_last_one():
    x_m, y_m = np.array([[3.0, 4.0]]), np.array([[8.0, 8.0]])
    cost = COSTS.progress(x_m, y_m, Waypoint(3.2, 8.0))
    assert cost[0] == pytest.approx(0.2 + SETTINGS.staying_weight * 0.8)


@pytest.mark.parametrize("distance_m", [0.0, 0.25, 0.5, 3.0])
def test_facing_away_costs_in_proportion_to_the_distance_up_to_half_a_metre(distance_m):
    error = np.array([0.0, math.pi, -math.pi / 2, 2.0 * math.pi])
    costs = COSTS.heading(error, distance_m)
    expected = np.array([0.0, math.pi, math.pi / 2, 0.0]) * min(1.0, distance_m / 0.5)
    np.testing.assert_allclose(costs, SETTINGS.heading_weight * expected, atol=1e-12)


def test_a_wall_within_the_margin_does_not_keep_the_robot_from_leaving():
    """It stands 0.275 m from the wall at x = 6 m, drives along, away and nearer."""
    around = COSTS.look(observation_at(5.725, 8.0))
    x_m = np.array([[5.725, 5.725], [5.70, 5.6], [5.725, 5.775]])
    _, too_close = COSTS.walls(x_m, np.array([[8.1, 8.2]] * 3), around, 2)
    assert too_close.tolist() == [[False, False], [False, False], [False, True]]


def test_walls_cost_by_the_nearest_one_of_all_times_and_forbid_the_first_times_only():
    """At x = 5.525 m and 5.675 m the wall at x = 6 m is 0.475 m and 0.325 m away."""
    x_m, y_m = np.array([[5.525, 5.675], [5.675, 5.775]]), np.full((2, 2), 8.02)
    for n_soon in (0, 1, 2):
        cost, too_close = COSTS.walls(x_m, y_m, COSTS.look(seen()), n_soon)
        gap_m = np.array([0.325 - 0.25 - SETTINGS.wall_margin_m, 0.0])
        expected = SETTINGS.wall_weight * np.exp(-gap_m / SETTINGS.wall_decay_m)
        np.testing.assert_allclose(cost, expected, rtol=1e-9)
        assert too_close.tolist() == [[False, False][:n_soon], [False, True][:n_soon]]


@pytest.mark.parametrize(("share", "is_too_close"), [(0.99, True), (1.0, False)])
@pytest.mark.parametrize("velocity", [(0.0, 0.0), (3.0, 0.0)])  # who stands, who leaves
def test_a_person_at_the_margin_is_not_too_close(share, is_too_close, velocity):
    """Both margins are 0.75 m and both radii 0.25 m: (3.75, 9) is 1.25 m from (3, 8)."""
    settings = CostSettings(person_margin_m=0.75, stopped_margin_m=0.75)
    costs = RolloutCosts(load_scenario("hallway"), COSTS_S, settings)
    around = costs.look(seen([(3.0 + 0.75 * share, 8.0 + share)], [velocity]))
    _, too_close = costs.people(np.array([[3.0, 2.5]]), np.full((1, 2), 8.0), around, 2)
    assert too_close.tolist() == [[is_too_close, False]]


@settings(max_examples=80)
@given(seed=st.integers(0, 10_000), n_people=st.integers(0, 10), n_soon=st.integers(0, 2))
def test_what_is_left_out_for_speed_changes_nothing(seed, n_people, n_soon):
    """Against the plain rule: every person, every time, every rollout."""
    rng = np.random.default_rng(seed)
    people = rng.uniform((-1, 5), (5, 11), (n_people, 2)), rng.normal(0, 1, (n_people, 2))
    observation = seen(*people)
    x_m, y_m = rng.uniform((1, 7), (3, 9), (4, 3, 2, 2)).transpose(3, 0, 1, 2)
    cost, too_close = COSTS.people(x_m, y_m, COSTS.look(observation), n_soon)
    expected_cost, expected = plainly(x_m, y_m, observation)
    np.testing.assert_allclose(cost, expected_cost, rtol=1e-12)
    np.testing.assert_array_equal(too_close, expected[..., :n_soon])


def plainly(x_m, y_m, observation):
    """Cost and closeness of rollouts (..., T), person by person; the nearest eight count."""
    place, velocity = observation.people_position_m, observation.people_velocity_mps
    away = np.hypot(*(place - (2.0, 8.0)).T)
    near = np.argsort(away, kind="stable")[: SETTINGS.max_people]
    near = near[away[near] < SETTINGS.people_range_m]

    def gaps(x, y):
        """The smallest gap to anybody, then and now."""
        then, now = np.full(x.shape, np.inf), np.full(x.shape, np.inf)
        for person in near:
            at = place[person] + COSTS_S[:, None] * velocity[person]
            then = np.minimum(then, np.hypot(x - at[:, 0], y - at[:, 1]) - 0.5)
            now = np.minimum(now, np.hypot(x - place[person, 0], y - place[person, 1]) - 0.5)
        return then, now

    (gap, gap_now), (standing, standing_now) = gaps(x_m, y_m), gaps(0 * x_m + 2.0, 0 * y_m + 8.0)
    if not len(near):
        return np.zeros(x_m.shape[:-1]), np.zeros(x_m.shape, dtype=bool)
    too_close = gap < np.minimum(SETTINGS.person_margin_m, standing - 1e-3)
    too_close = too_close | (gap_now < np.minimum(SETTINGS.stopped_margin_m, standing_now - 1e-3))
    decay = SETTINGS.people_decay_m
    nearness = np.exp(-np.maximum(gap, -decay) / decay) * np.exp(-COSTS_S / SETTINGS.foresight_s)
    return SETTINGS.people_weight * nearness.max(axis=-1), too_close


@pytest.mark.parametrize(("cell_size_m", "share"), [(2.0, 1.0), (0.5, 0.5), (0.001, 0.387)])
def test_the_finer_the_cells_the_nearer_a_wall_may_be_and_the_raster_has_a_million_cells(
    cell_size_m, share
):
    scenario = load_scenario("hallway").model_copy(update={"cell_size_m": cell_size_m})
    costs = RolloutCosts(scenario, np.array([0.1, 0.2]))
    assert costs._walls.distance_m.size < 1.1e6
    margin_m = costs._least_wall_m - scenario.robot.radius_m
    assert margin_m == pytest.approx(0.05 * share, rel=1e-3)
    assert costs._wall_decay_m == pytest.approx(0.12 * share, rel=1e-3)
    assert margin_m > 0.5 * math.sqrt(2.0) * costs._walls.resolution_m


def predicted(people, velocity=None, *, most=8):
    """(K, 2, 4) of people within 5 m, now and later."""
    seen = observation_at(1.0, 2.0, people=people, velocity=velocity)
    return predict_nearby(seen, 5.0, most, np.array([0.0, 0.5, 1.0, 2.0]))


def test_a_person_without_a_finite_position_is_left_out_and_one_without_a_velocity_stands():
    velocity = [(1.0, 1.0), (math.nan, 1.0), (1.0, math.inf), (1.0, 0.0)]
    people = predicted([(math.nan, 2.0), (2.0, 2.0), (2.0, 3.0), (2.0, 4.0)], velocity)
    np.testing.assert_array_equal(people[:, 0], [[2.0] * 4, [2.0] * 4, [2.0, 2.5, 3.0, 4.0]])
    np.testing.assert_array_equal(people[:, 1], [[2.0] * 4, [3.0] * 4, [4.0] * 4])


def test_a_long_robot_is_driven_so_that_no_corner_meets_a_wall_or_a_person():
    """It turns off a wall beside it, which it could not do in place, past a person, and back."""
    text = "[[0.5, 0.3], [-0.5, 0.3], [-0.5, -0.3], [0.5, -0.3]]"
    scenario = load_scenario("hallway").with_values("robot", footprint=text, radius_m=0.3)
    planner, body, robot = make_planner(scenario), scenario.robot.outline, scenario.robot
    walls, outline_m = wall_distance_raster(scenario), body.outline_m(0.02)
    person_m, pose, speeds, tick = np.array([[3.4, 4.5]]), (0.4, 3.0, math.pi / 2), (0.0, 0.0), 0
    for goal in (Waypoint(3.5, 3.5), Waypoint(3.5, 5.5), Waypoint(1.0, 3.5)):
        while math.hypot(pose[0] - goal.x_m, pose[1] - goal.y_m) > 0.3:
            seen = observation_at(
                *pose, tick=tick, speed_mps=speeds[0], yaw_rate_radps=speeds[1], people=person_m
            )
            speeds = limited_velocity(planner.step(seen, goal), *speeds, robot, 0.05)
            moved = compose((0.0, 0.0, 0.5 * speeds[1] * 0.05), (speeds[0] * 0.05, 0.0, 0.0))
            pose = compose(pose, (*moved[:2], speeds[1] * 0.05))
            tick += 1
            assert walls.at(*out_of_frame(outline_m, pose).T).min() > 0.0
            assert body.gaps_m(np.array([pose]), person_m).min() > 0.25
            assert tick < 800, "it does not arrive"
