"""The crowd as a whole: walls hold, loops are walked, speeds fall with density."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import norm

from sim.crowd import Crowd, RobotBody, people_per_loop, start_crowd
from sim.polygon import contains, distance_to_segments_m
from sim.routes import Routes, offset_loop
from sim.scenario import load_scenario
from sim.social_force import model_named, model_names

HALLWAY = load_scenario("hallway")


def hallway_crowd(count, seed, model="circular_anisotropic"):
    settings = HALLWAY.with_pedestrian_count(count).pedestrians
    settings = settings.model_copy(update={"model": model})
    return start_crowd(
        settings, settings.loops, HALLWAY.wall_segments_m, np.random.default_rng(seed)
    )


def test_the_same_seed_gives_the_same_walk_bit_for_bit():
    walks = []
    for _ in range(2):
        crowd = hallway_crowd(24, 3)
        for _ in range(200):
            crowd.step(0.05)
        walks.append((crowd.x_m.copy(), crowd.y_m.copy()))
    np.testing.assert_array_equal(walks[0], walks[1])


def test_a_restored_snapshot_repeats_what_followed_exactly():
    crowd = hallway_crowd(24, 4)
    for _ in range(50):
        crowd.step(0.05)
    state = crowd.snapshot()
    ends = []
    for _ in range(2):
        crowd.restore(state)
        for _ in range(100):
            crowd.step(0.05)
        ends.append(crowd.x_m.copy())
    np.testing.assert_array_equal(ends[0], ends[1])


@pytest.mark.parametrize("model", model_names())
def test_nobody_leaves_a_crowded_hallway(model):
    crowd = hallway_crowd(150, 5, model)
    for _ in range(400):
        crowd.step(0.05)
    place = np.stack([crowd.x_m, crowd.y_m], axis=1)
    assert contains(HALLWAY.walkable_area_m, place).all()


def test_a_robot_that_squeezes_people_against_a_wall_pushes_nobody_through_it():
    crowd = hallway_crowd(24, 6)
    crowd.x_m[0], crowd.y_m[0] = 5.9, 10.0
    for x_m in np.linspace(5.0, 5.75, 30):
        robot = RobotBody(x_m, 10.0, 0.3, 0.0, 0.25)
        crowd.step(0.05, robot)
        crowd.push_out_of(robot)
    place = np.stack([crowd.x_m, crowd.y_m], axis=1)
    assert contains(HALLWAY.walkable_area_m, place).all()
    assert distance_to_segments_m(place, HALLWAY.wall_segments_m).min() > 0.1


def test_people_walk_on_the_right_of_the_hallway():
    crowd = hallway_crowd(24, 7)
    on_their_side = total = 0
    for _ in range(600):
        crowd.step(0.05)
        middle = (crowd.y_m > 4) & (crowd.y_m < 14) & (np.abs(crowd.velocity_y_mps) > 0.5)
        right = np.where(crowd.velocity_y_mps > 0, crowd.x_m > 3, crowd.x_m < 3)
        on_their_side += int((right & middle).sum())
        total += int(middle.sum())
    assert total > 1000
    assert on_their_side / total > 0.97


def ring_speed_mps(density_pm2, seed=1):
    """Mean speed of one-way walkers in a ring corridor of 4 m width at a density."""
    width, length = 4.0, 20.0
    count = round(density_pm2 * width * length)
    rng = np.random.default_rng(seed)
    columns = int(np.ceil(np.sqrt(count * length / width)))
    slots = rng.permutation(columns * int(np.ceil(count / columns)))[:count]
    x = (slots % columns + 0.5) * length / columns
    y = 0.3 + (slots // columns + 0.5) * (width - 0.6) / int(np.ceil(count / columns))
    speed = rng.permutation(norm(1.34, 0.26).ppf((np.arange(count) + 0.5) / count))
    far = 1e7
    loops = [np.array([[-far, v], [far, v], [far, v + far], [-far, v + far]]) for v in y]
    routes = Routes(loops)
    routes.place(np.full(count, 0.5 * 2 * far / (6 * far)))
    walls = np.array([[[-100.0, 0.0], [100.0, 0.0]], [[100.0, width], [-100.0, width]]])
    crowd = Crowd(
        model=model_named("circular_anisotropic"),
        routes=routes,
        x_m=x,
        y_m=y,
        desired_speed_mps=speed,
        walls_m=walls,
        fluctuation_mps2=0.1,
        rng=rng,
        period_m=length,
    )
    speeds = []
    for step in range(1000):
        crowd.step(0.05)
        if step >= 400:
            speeds.append(crowd.velocity_x_mps.mean())
    return float(np.mean(speeds))


@pytest.mark.parametrize("density_pm2", [0.5, 1.0, 1.5, 2.0])
def test_walking_speed_falls_with_density_as_weidmann_measured(density_pm2):
    """Weidmann (1993): v = 1.34 (1 - exp(-1.913 (1 / rho - 1 / 5.4)))."""
    expected = 1.34 * (1.0 - np.exp(-1.913 * (1.0 / density_pm2 - 1.0 / 5.4)))
    assert ring_speed_mps(density_pm2) == pytest.approx(expected, abs=0.1)


def test_people_are_shared_out_to_loops_by_largest_remainder():
    loops = HALLWAY.pedestrians.loops
    assert people_per_loop(loops, 24) == [12, 6, 6]
    assert people_per_loop(loops, 0) == [0, 0, 0]
    assert sum(people_per_loop(loops, 17)) == 17


def test_a_loop_moved_to_the_left_is_a_smaller_loop():
    square = np.array([[0, 0], [4, 0], [4, 4], [0, 4.0]])
    np.testing.assert_allclose(
        offset_loop(square, 0.5), [[0.5, 0.5], [3.5, 0.5], [3.5, 3.5], [0.5, 3.5]]
    )


def test_wanted_speeds_lie_within_two_deviations_of_the_mean():
    speed = hallway_crowd(400, 8).desired_speed_mps
    settings = HALLWAY.pedestrians
    limit = 2 * settings.desired_speed_deviation_mps + 1e-12
    assert np.abs(speed - settings.desired_speed_mean_mps).max() <= limit
    assert speed.mean() == pytest.approx(settings.desired_speed_mean_mps, abs=0.04)


def test_an_empty_crowd_walks_nowhere():
    crowd = hallway_crowd(0, 1)
    crowd.step(0.05, RobotBody(1.0, 1.0, 0.0, 0.0, 0.25))
    assert len(crowd) == 0
    assert dataclasses.is_dataclass(crowd.snapshot())
