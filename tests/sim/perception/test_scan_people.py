"""People found in the lidar alone."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from serd_sim.perception.scan_people import (
    FASTEST_MPS,
    LidarPeople,
    PeopleTracker,
    people_in_scan,
)
from serd_sim.perception.scanning_planner import ScanningPlanner
from serd_sim.robot.sensors import Lidar
from serd_sim.safety.reasons import Fault
from serd_sim.safety.scan import Scan, ScanGeometry
from serd_sim.safety.settings import GuardSettings
from serd_sim.scenario.occupancy import wall_distance_raster
from serd_sim.scenario.scenario import load_scenario
from serd_sim.scenario.settings import LidarSettings
from serd_sim.world.waypoint import Waypoint
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


def test_a_planner_by_scans_knows_nothing_of_people_but_what_the_scans_show():
    """Without given people it drives as with them: it reads only the scans."""
    blind, ahead = observation_at(3.0, 8.0, 1.5), np.array([[3.0, 9.0]])

    def commands(observation, people):
        ranges = LIDAR.scan(observation.pose, people[:, 0], people[:, 1])
        world = SimpleNamespace(scenario=HALLWAY, is_scan_tick=True, scan=lambda _: ranges)
        planner = ScanningPlanner(world)
        return [planner.step(observation, Waypoint(3.0, 10.0)) for _ in range(3)]

    assert commands(blind, ahead) == commands(HALLWAY_SEEN, ahead)
    assert commands(blind, ahead) != commands(blind, np.zeros((0, 2)))


GEOMETRY = ScanGeometry(-math.pi, math.tau / 360, 0.1, 10.0)
CENTRE = 0.0, 0.0, 0.0
STANDING = 3.0, 8.0, 0.0
WALKER = 2.0, 8.0


@pytest.fixture
def people():
    return LidarPeople(HALLWAY, GuardSettings.of_scenario(HALLWAY, "scan"))


def ranges_of(pose, *places):
    place = np.array(places, float).reshape(-1, 2)
    return LIDAR.scan(pose, place[:, 0], place[:, 1], np.random.default_rng(1))


def scan_of(pose, *places, time_s):
    return Scan(time_s, ranges_of(pose, *places), GEOMETRY, CENTRE)


def seen_at(people, time_s, pose=STANDING):
    return people.step(observation_at(*pose, time_s=time_s))


def test_a_scan_between_two_poses_is_taken_where_the_robot_was_between_them(people):
    """By either neighbour's pose the walker would be seen 0.2 m off."""
    half = 3.0, 8.0, 0.2
    people.take_scan(scan_of(half, WALKER, time_s=1.05))
    assert seen_at(people, 1.0, (2.9, 8.0, 0.0)) is Fault.MISSING
    found = seen_at(people, 1.1, (3.1, 8.0, 0.4))
    assert found.position_m == pytest.approx(np.array([WALKER]), abs=0.05)


def test_a_turned_lidar_off_the_centre_that_sees_half_a_circle_shows_people_in_the_map(people):
    """One stands ahead of the lidar, one behind it."""
    mount, pose, places = (-0.1, 0.05, math.pi / 2), (3.0, 8.0, 0.3), ((2.0, 8.5), (4.5, 7.5))
    lidar_m = pose[0] + 1j * pose[1] + np.exp(1j * pose[2]) * (mount[0] + 1j * mount[1])
    lidar = lidar_m.real, lidar_m.imag, pose[2] + mount[2]
    geometry = ScanGeometry(-math.pi / 2, math.tau / 360, 0.1, 10.0)
    seen_at(people, 1.0, pose)
    people.take_scan(Scan(1.0, ranges_of(lidar, *places)[90:270], geometry, mount))
    found = seen_at(people, 1.05, pose)
    assert found.position_m == pytest.approx(np.array(places[:1]), abs=0.06)


@pytest.mark.parametrize("lost", [0.0, math.inf, math.nan])
def test_a_blind_or_silent_lidar_is_a_fault_and_not_an_empty_place(people, lost):
    assert seen_at(people, 1.0) is Fault.MISSING
    people.take_scan(scan_of(STANDING, WALKER, time_s=1.0))
    assert len(seen_at(people, 1.05).identity) == 1
    ranges_m = ranges_of(STANDING, WALKER)
    ranges_m[:180] = lost
    people.take_scan(Scan(1.1, ranges_m, GEOMETRY, CENTRE))
    assert seen_at(people, 1.1) is Fault.BLIND
    people.take_scan(scan_of(STANDING, WALKER, time_s=1.2))
    assert len(seen_at(people, 1.4).identity) == 1
    assert seen_at(people, 1.5) is Fault.STALE


def test_a_scan_that_stays_the_same_while_the_robot_moves_is_a_fault(people):
    answers = []
    for tick in range(4):
        time_s = 1.0 + 0.1 * tick
        people.take_scan(scan_of(STANDING, WALKER, time_s=time_s))
        answers.append(seen_at(people, time_s, (3.0 + 0.03 * tick, 8.0, 0.0)))
    assert [isinstance(each, Fault) for each in answers] == [False, False, True, True]
    assert answers[-1] is Fault.FROZEN


def test_after_a_reset_a_scan_that_waits_is_taken_and_tracks_begin_at_0(people):
    seen_at(people, 1000.0)
    people.take_scan(scan_of(STANDING, WALKER, time_s=1000.0))
    assert len(seen_at(people, 1000.1).identity) == 1
    people.take_scan(scan_of(STANDING, WALKER, time_s=0.0))
    people.reset()
    assert seen_at(people, 0.0).identity.tolist() == [0]


@pytest.mark.parametrize(("nothing_m", "range_max_m"), [(0.0, 10.0), (5.0, 5.0)])
def test_rays_that_meet_nothing_are_no_people_whatever_number_stands_for_them(
    people, nothing_m, range_max_m
):
    """Lidars whose range_min is 0 send 0, and many simulated ones range_max."""
    ranges_m = ranges_of(STANDING, WALKER)
    ranges_m = np.where(ranges_m < 5.0, ranges_m, np.float32(nothing_m))
    geometry = ScanGeometry(-math.pi, math.tau / 360, 0.0, range_max_m)
    people.take_scan(Scan(1.0, ranges_m, geometry, CENTRE))
    found = seen_at(people, 1.0)
    assert found.position_m == pytest.approx(np.array([WALKER]), abs=0.05)
