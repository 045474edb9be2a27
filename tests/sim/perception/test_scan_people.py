"""People found in the lidar alone."""

import numpy as np
import pytest

from serd_files.errors import USER_ERRORS
from serd_sim.drivers.catalogue import ScriptedExpert
from serd_sim.episodes.episode import run_episode
from serd_sim.perception.scan_people import (
    FASTEST_MPS,
    PeopleTracker,
    ScanPerception,
    people_in_scan,
)
from serd_sim.perception.scanning_planner import ScanningPlanner, planner_in_world
from serd_sim.planning.local_planner import make_planner
from serd_sim.robot.sensors import Lidar
from serd_sim.scenario.occupancy import wall_distance_raster
from serd_sim.scenario.scenario import load_scenario
from serd_sim.scenario.settings import LidarSettings
from serd_sim.world.waypoint import Waypoint
from serd_sim.world.world import HallwayWorld
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
HALLWAY_SEEN = observation_at(3.0, 8.0, 1.5, people=[[2.0, 9.0]], velocity=[[0.0, -1.0]])
LIDAR = Lidar(HALLWAY.lidar, HALLWAY.wall_segments_m, 0.25)
WALLS = wall_distance_raster(HALLWAY)


def found(pose, people, noise_m=0.0):
    people = np.array(people, float).reshape(-1, 2)
    lidar = Lidar(LidarSettings(noise_deviation_m=noise_m), HALLWAY.wall_segments_m, 0.25)
    ranges = lidar.scan(pose, people[:, 0], people[:, 1], np.random.default_rng(1))
    return people_in_scan(ranges, lidar.angles_rad, pose, WALLS, 0.25)


@pytest.mark.parametrize("noise_m", [0.0, 0.02])
def test_an_empty_hallway_holds_nobody_even_with_noise(noise_m):
    assert len(found((3.0, 8.0, 0.4), [], noise_m)) == 0


def test_noise_of_many_rays_shows_few_people_and_the_nearest():
    n_rays = 60_000
    ranges = np.random.default_rng(1).uniform(4.0, 7.0, n_rays).astype(np.float32)
    ranges[:200] = 2.0
    angles = np.linspace(0.0, 2.0 * np.pi, n_rays, endpoint=False)
    centers = people_in_scan(ranges, angles, (3.0, 8.0, 0.0), WALLS, 0.25)
    assert len(centers) <= 500
    assert centers[0] == pytest.approx([5.2, 8.0], abs=0.05)


def test_rays_that_are_no_numbers_are_rays_without_a_return():
    pose, people = (3.0, 8.0, 0.4), np.array([[1.5, 8.0], [4.5, 9.0]])
    ranges = LIDAR.scan(pose, people[:, 0], people[:, 1])
    centers = []
    for lost in (np.nan, np.inf):
        ranges[::7] = lost
        centers.append(people_in_scan(ranges, LIDAR.angles_rad, pose, WALLS, 0.25))
    assert len(centers[0]) == 2
    np.testing.assert_array_equal(*centers)
    assert len(people_in_scan(ranges * np.nan, LIDAR.angles_rad, pose, WALLS, 0.25)) == 0


@pytest.mark.parametrize("yaw_rad", [0.0, 3.1, -1.5])
def test_people_around_the_robot_are_found_where_they_are(yaw_rad):
    people = np.array([[1.5, 8.0], [4.5, 9.0], [3.0, 5.5], [2.0, 11.0]])
    centers = found((3.0, 8.0, yaw_rad), people, noise_m=0.01)
    assert len(centers) == 4
    away = np.linalg.norm(people[:, None] - centers[None], axis=2)
    assert away.min(axis=1).max() < 0.08


def test_two_people_shoulder_to_shoulder_are_two():
    assert len(found((3.0, 6.0, 0.0), [[2.72, 8.0], [3.28, 8.0]])) == 2


def test_a_tracked_walker_gets_the_right_velocity_and_keeps_the_number():
    tracker = PeopleTracker()
    rng = np.random.default_rng(2)
    for step in range(40):
        place = np.array([[1.0 + 0.13 * step, 2.0]]) + rng.normal(0, 0.01, (1, 2))
        tracker.update(place, 0.1 * step)
    assert tracker.identity.tolist() == [0]
    assert tracker.velocity_mps[0] == pytest.approx([1.3, 0.0], abs=0.1)


def test_nobody_is_believed_to_walk_faster_than_people_do():
    """Detections that leap by 0.4 m a scan are one track, but not one of 4 m/s."""
    tracker = PeopleTracker()
    for step in range(20):
        tracker.update(np.array([[0.4 * step, 2.0]]), 0.1 * step)
    speeds = np.hypot(*tracker.velocity_mps.T)
    assert speeds.max() == pytest.approx(FASTEST_MPS)


def test_somebody_unseen_is_remembered_for_half_a_second_and_then_forgotten():
    tracker = PeopleTracker()
    tracker.update(np.array([[1.0, 2.0]]), 0.0)
    tracker.update(np.zeros((0, 2)), 0.4)
    assert len(tracker.identity) == 1
    tracker.update(np.zeros((0, 2)), 0.6)
    assert len(tracker.identity) == 0


def test_the_robot_arrives_without_driving_into_anybody_by_the_scan_alone():
    scenario = load_scenario("crossing").with_values("lidar", noise_deviation_m=0.02)
    with HallwayWorld(scenario, seed=3) as world:
        planner = planner_in_world(world, "scan")
        record = run_episode(world, planner, ScriptedExpert(scenario, 3), episode=0)
    assert record.outcome == "arrived"
    assert record.contacts.robot_on_person == record.contacts.robot_on_wall == 0


def test_a_planner_by_scans_knows_nothing_of_people_but_what_the_scans_show():
    """Without given people it drives as with them: it reads only the scans."""
    blind, ahead = observation_at(3.0, 8.0, 1.5), np.array([[3.0, 9.0]])

    def commands(observation, people):
        ranges = LIDAR.scan(observation.pose, people[:, 0], people[:, 1])
        planner = ScanningPlanner(
            make_planner(HALLWAY).planner, HALLWAY, ScanPerception(HALLWAY), lambda _: ranges
        )
        return [planner.step(observation, Waypoint(3.0, 10.0)) for _ in range(3)]

    assert commands(blind, ahead) == commands(HALLWAY_SEEN, ahead)
    assert commands(blind, ahead) != commands(blind, np.zeros((0, 2)))


def test_a_scan_with_another_number_of_rays_is_refused_with_the_fix():
    with pytest.raises(USER_ERRORS, match=r"must have 360 rays .*, got \(180,\); set lidar.n_rays"):
        ScanPerception(HALLWAY).take(HALLWAY_SEEN, np.ones(180, dtype=np.float32))
