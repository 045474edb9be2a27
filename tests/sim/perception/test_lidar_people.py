"""People round a robot by a lidar with a clock, a mount and a field of view of its own."""

import math

import numpy as np
import pytest

from serd_sim.perception.lidar_people import LidarPeople
from serd_sim.robot.sensors import Lidar
from serd_sim.safety.reasons import Fault
from serd_sim.safety.scan import Scan, ScanGeometry
from serd_sim.safety.settings import GuardSettings
from serd_sim.scenario.scenario import load_scenario
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
LIDAR = Lidar(HALLWAY.lidar, HALLWAY.wall_segments_m, 0.25)
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


def test_people_are_predicted_to_the_time_of_the_pose(people):
    for tick in range(40):
        time_s = 0.1 * tick
        people.take_scan(scan_of(STANDING, (1.0, 7.0 + time_s), time_s=time_s))
        seen_at(people, time_s)
    found = seen_at(people, 4.0)
    assert found.velocity_mps == pytest.approx(np.array([[0.0, 1.0]]), abs=0.15)
    assert found.position_m == pytest.approx(np.array([[1.0, 11.0]]), abs=0.1)


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


def test_late_scans_and_those_before_the_first_pose_are_left_out(people):
    people.take_scan(scan_of(STANDING, WALKER, time_s=0.9))
    assert seen_at(people, 1.0) is Fault.MISSING
    people.take_scan(scan_of(STANDING, WALKER, time_s=1.05))
    people.take_scan(scan_of(STANDING, (4.5, 9.0), time_s=1.02))
    found = seen_at(people, 1.1)
    assert found.position_m == pytest.approx(np.array([WALKER]), abs=0.06)


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
