"""The lidar against closed forms and against the physics world's own ray tests."""

import math
from dataclasses import replace

import numpy as np
import pytest

from serd_sim.robot.bullet import add_wall, new_world, pybullet
from serd_sim.robot.sensors import Lidar, Odometry
from serd_sim.scenario.scenario import load_scenario
from serd_sim.scenario.settings import LidarSettings, OdometrySettings
from serd_sim.world.command import STOP, Command
from serd_sim.world.world import HallwayWorld

HALLWAY = load_scenario("hallway")
LIDAR = Lidar(LidarSettings(), HALLWAY.wall_segments_m, 0.25)
NO_PEOPLE = np.zeros(0)


def test_the_walls_of_the_empty_hallway_are_seen_at_their_distances():
    ranges = LIDAR.scan((2.0, 8.0, 0.0), NO_PEOPLE, NO_PEOPLE)
    assert ranges.dtype == np.float32
    assert ranges[[180, 0, 90]] == pytest.approx([4.0, 2.0, 8.0], abs=1e-5)
    assert np.isinf(ranges[270])


@pytest.mark.parametrize("pose", [(2.0, 8.0, 0.3), (5.0, 17.0, -2.0)])
def test_the_scan_is_that_of_the_physics_worlds_ray_tests(pose):
    rng = np.random.default_rng(3)
    people_x, people_y = rng.uniform(0, 6, 24), rng.uniform(6, 20, 24)
    far = np.hypot(people_x - pose[0], people_y - pose[1]) > 0.6
    people_x, people_y = np.where(far, people_x, 0.3), np.where(far, people_y, 0.3)
    client = new_world()
    for wall in HALLWAY.wall_segments_m:
        add_wall(client, *wall)
    capsule = client.createCollisionShape(pybullet.GEOM_CAPSULE, radius=0.25, height=1.25)
    for x_m, y_m in zip(people_x, people_y, strict=True):
        client.createMultiBody(0.0, capsule, -1, (x_m, y_m, 0.875))
    angle = LIDAR.angles_rad + pose[2]
    direction = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    start = np.array([pose[0], pose[1], 0.3]) + 0.1 * direction
    hits = client.rayTestBatch(start.tolist(), (start + 9.9 * direction).tolist(), numThreads=1)
    client.disconnect()
    share = np.array([hit[2] for hit in hits])
    expected = np.where(share < 1.0, 0.1 + 9.9 * share, np.inf)
    ranges = LIDAR.scan(pose, people_x, people_y)
    both = np.isfinite(expected) & np.isfinite(ranges)
    assert both.mean() > 0.5
    assert (np.isfinite(expected) == np.isfinite(ranges)).mean() > 0.99
    assert np.percentile(np.abs(ranges[both] - expected[both]), 98) < 0.005


def test_noise_has_its_deviation_and_is_the_same_when_asked_twice_at_one_tick():
    """A scan is due at every second control period."""
    noisy = HALLWAY.with_pedestrian_count(0).with_values("lidar", noise_deviation_m=0.02)
    with HallwayWorld(noisy, seed=4) as world:
        seen = world.reset(1)
        first, second = world.scan(seen), world.scan(replace(seen))
        due = [world.is_scan_tick for _ in range(6) if world.step(STOP)]
    clean = LIDAR.scan(seen.pose, NO_PEOPLE, NO_PEOPLE)
    np.testing.assert_array_equal(first, second)
    both = np.isfinite(clean) & np.isfinite(first)
    error = first[both] - clean[both]
    assert error.std() == pytest.approx(0.02, rel=0.2)
    assert abs(error.mean()) < 0.005
    assert due == [False, True] * 3


@pytest.mark.parametrize(
    ("nearest_m", "farthest_m", "seen_m"),
    [(2.0, 10.0, 3.0), (4.0, 10.0, -np.inf), (0.1, 2.5, np.inf)],
)
def test_what_is_nearer_than_the_lidar_measures_is_minus_infinite_and_what_is_farther_infinite(
    nearest_m, farthest_m, seen_m
):
    settings = LidarSettings(n_rays=4, range_min_m=nearest_m, range_max_m=farthest_m)
    lidar = Lidar(settings, np.array([[[3.0, -50.0], [3.0, 50.0]]]), 0.25)
    ahead = int(np.argmin(np.abs(lidar.angles_rad)))
    assert lidar.scan((0.0, 0.0, 0.0), NO_PEOPLE, NO_PEOPLE)[ahead] == pytest.approx(seen_m)


EMPTY = load_scenario("hallway").with_pedestrian_count(0)


def straight(odometry, n_steps):
    for step in range(1, n_steps + 1):
        odometry.follow((0.05 * step, 0.0, 0.0))
    return odometry.pose


def test_without_deviations_odometry_is_the_truth_bit_for_bit_and_with_them_it_drifts():
    """Wheels of a physical robot slip, so this one is kinematic."""
    exact = EMPTY.with_values("robot", drive="kinematic")
    drifting = exact.with_values("odometry", distance_scale_deviation=0.05, turn_noise_rad=0.05)
    poses = []
    for scenario in (exact, drifting):
        with HallwayWorld(scenario, seed=1) as world:
            world.reset(0)
            for _ in range(50):
                seen = world.step(Command(0.6, 0.5))
            poses += [seen.pose[:2], world.odometry_pose[:2]]
    assert poses[0] == poses[1] == poses[2]
    assert math.dist(*poses[2:]) > 0.01


def test_a_scale_error_stretches_the_way():
    settings = OdometrySettings(distance_scale_deviation=0.1)
    rng = np.random.default_rng(1)
    scale = 1.0 + 0.1 * np.random.default_rng(1).standard_normal(2)[0]
    x_m, y_m, yaw_rad = straight(Odometry(settings, (0.0, 0.0, 0.0), rng), 200)
    assert (x_m, y_m, yaw_rad) == pytest.approx((10.0 * scale, 0.0, 0.0))


def test_turn_noise_grows_with_the_root_of_the_way():
    settings = OdometrySettings(turn_noise_rad=0.02)
    rngs = [np.random.default_rng(seed) for seed in range(200)]
    yaws = [straight(Odometry(settings, (0.0, 0.0, 0.0), rng), 200)[2] for rng in rngs]
    assert np.std(yaws) == pytest.approx(0.02 * math.sqrt(10.0), rel=0.15)
