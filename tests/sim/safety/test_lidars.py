"""Lidars of different makers in front of a wall: no reading drives a robot into it.

Each fault has a healthy twin that travels more than 5 m and stands before the wall."""

import math
from dataclasses import replace

import numpy as np
import pytest

from serd_sim.safety.reasons import GuardAction
from serd_sim.safety.scan import Scan, ScanGeometry, ZeroRanges, shown_by
from serd_sim.world.command import Command
from support.corridor import AHEAD, RADIUS_M, Corridor


def test_a_healthy_robot_travels_and_stands_before_the_wall():
    corridor = Corridor().run()
    assert corridor.pose[0] > 5.0
    assert 0.0 < corridor.gap_m < 0.1
    assert corridor.faults == {"COLLISION"}


@pytest.mark.parametrize(
    ("value", "degrees", "n_rays"),
    [
        (-np.inf, 10, 360), (0.05, 40, 97), (0.02, 90, 360), (-1.0, 358, 97), (np.nan, 10, 360),
        (np.nan, 358, 97), (0.0, 40, 97), (0.0, 90, 360), (np.inf, 10, 360), (np.inf, 90, 360),
        (np.inf, 358, 97), (12.0, 40, 97), (65.5, 90, 360),
    ],
)  # fmt: skip
def test_no_reading_of_a_sector_ahead_drives_the_robot_into_the_wall(value, degrees, n_rays):
    corridor = Corridor(n_rays=n_rays).sector(value, degrees).run()
    assert corridor.gap_m > 0.0
    assert corridor.speeds[0] == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("n_rays", [4, 8, 9, 12, 17, 24, 31])
def test_a_robot_whose_lidar_has_few_rays_creeps_and_stands_before_the_wall(n_rays):
    corridor = Corridor(n_rays=n_rays).run(3.0)
    assert max(corridor.speeds) <= 0.11
    assert "NOT_IN_VIEW" in corridor.faults
    corridor.run(75.0)
    assert corridor.pose[0] > 5.0
    assert corridor.gap_m > 0.0
    assert corridor.speeds[0] == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("n_rays", [4, 12, 31])
def test_a_robot_whose_lidar_has_few_rays_creeps_with_a_map_too(n_rays):
    corners = np.array([[-3.0, -1.5], [30.0, -1.5], [30.0, 1.5], [-3.0, 1.5]])
    walls_m = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    corridor = Corridor(n_rays=n_rays, wall_m=30.0, walls_m=walls_m).run(10.0)
    assert corridor.pose[0] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("value", [-np.inf, 0.05])
def test_a_return_that_is_too_near_is_an_obstacle_at_range_min(value):
    corridor = Corridor().sector(value, 40.0).run(8.0)
    assert corridor.pose[0] < 3.5
    assert corridor.outputs[-1].action is GuardAction.STOP
    assert "COLLISION" in corridor.faults
    corridor.sector(value, 0.0).run(8.0)
    assert 0.0 < corridor.gap_m < 0.1


@pytest.mark.parametrize("start_m", [0.0, 5.55, 5.7])
def test_a_wall_nearer_than_a_large_range_min_is_no_obstacle_that_goes_along(start_m):
    corridor = Corridor(range_m=(0.6, 12.0), start=(start_m, 0.0, 0.0))
    corridor.change = lambda ranges_m, _: np.where(ranges_m < 0.6, -np.inf, ranges_m)
    corridor.run()
    assert 0.0 < corridor.gap_m < 0.21
    assert corridor.gap_m < 0.15 or start_m


@pytest.mark.parametrize("value", [np.nan, 0.0])
def test_a_robot_drives_no_faster_than_it_can_stop_within_what_is_known(value):
    corridor = Corridor(wall_m=30.0).sector(value, 60.0)
    corridor.run(8.0)
    assert 3.0 < corridor.pose[0] < 5.5  # on what it has seen before, less what people walk
    assert corridor.outputs[-1].action is GuardAction.STOP
    assert "UNKNOWN" in corridor.faults
    corridor.sector(value, 0.0).run(5.0)
    assert corridor.speeds[0] == pytest.approx(1.2)


def test_single_rays_without_a_statement_are_bridged():
    one_in_twenty = np.arange(360) % 20 == 0
    corridor = Corridor(lambda ranges_m, _: np.where(one_in_twenty, np.nan, ranges_m)).run(4.0)
    assert corridor.pose[0] > 4.0
    assert corridor.faults == set()
    assert corridor.run().gap_m < 0.1


@pytest.mark.parametrize(
    ("zero_is", "drives"), [("free", True), ("unknown", False), ("obstacle", False)]
)
def test_what_zero_means_is_a_setting_of_the_lidar(zero_is, drives):
    corridor = Corridor(
        lambda ranges_m, _: np.where(ranges_m > 4.0, 0.0, ranges_m),
        zero_is=zero_is, wall_m=40.0, sides_m=(-20.0, 20.0), range_m=(0.1, 4.0),
    )  # fmt: skip
    way_m = corridor.run(8.0).pose[0]
    assert way_m > 8.0 if drives else way_m == 0.0


@pytest.mark.parametrize("n_rays", [90, 1081])
def test_a_lidar_of_short_range_drives_in_a_wide_room(n_rays):
    """All of its rays are +inf, and all scans equal."""
    wide = {"wall_m": 60.0, "sides_m": (-20.0, 20.0), "range_m": (0.1, 3.5)}
    corridor = Corridor(n_rays=n_rays, **wide).run()
    assert corridor.pose[0] > 10.0
    assert corridor.faults == set()


@pytest.mark.parametrize(
    ("degrees", "fault", "most_m"),
    [(40, "LOST_SECTOR", 6.0), (90, "LOST_SECTOR", 6.0), (360, "BLIND", 3.6)],
)
def test_a_sector_that_turns_free_at_once_is_lost_and_named_until_it_has_returns(
    degrees, fault, most_m
):
    corridor = Corridor(wall_m=8.0).sector(np.inf, degrees).run()
    assert fault in corridor.faults
    assert 3.0 < corridor.pose[0] < most_m
    corridor.sector(np.inf, 0.0).run(8.0)
    assert 0.0 < corridor.gap_m < 0.1
    assert fault not in {each.fault.name for each in corridor.outputs[-1].reasons}


@pytest.mark.parametrize("degrees", [60.0, 0.0])
def test_a_free_sector_where_the_map_has_a_wall_in_reach_is_lost(degrees):
    corners = np.array([[-3.0, -1.5], [6.0, -1.5], [6.0, 1.5], [-3.0, 1.5]])
    walls_m = np.stack([corners[:-1], corners[1:]], axis=1)
    corridor = Corridor(walls_m=walls_m).sector(np.inf, degrees, after_m=-1.0).run()
    assert ("LOST_SECTOR" in corridor.faults) == (degrees > 0.0)
    assert corridor.gap_m > 3.0 if degrees else corridor.gap_m < 0.1


@pytest.mark.parametrize("scan_ticks", [1, 4])
def test_somebody_who_steps_aside_is_held_for_a_moment_and_delays_nobody_for_long(scan_ticks):
    """A person 0.5 m wide before a free room, who leaves at walking pace."""
    room = {"wall_m": 60.0, "sides_m": (-20.0, 20.0), "range_m": (0.1, 5.0)}
    corridor = Corridor(**room, scan_ticks=scan_ticks)

    def person(ranges_m, _):
        x_m, y_m = 2.0 - corridor.pose[0], 1.3 * max(corridor.time_s - 2.0, 0.0)
        away_m, bearing = math.hypot(x_m, y_m), math.atan2(y_m, x_m)
        on_body = np.abs(corridor.angles_rad - bearing) < math.asin(min(0.25 / away_m, 1.0))
        return np.where(on_body, away_m - 0.25, ranges_m)

    corridor.change = person
    for duration_s in (2.0, 0.2):
        assert corridor.run(duration_s).pose[0] + RADIUS_M < 1.75
    assert corridor.run(4.0).pose[0] > 3.0
    assert "LOST_SECTOR" not in corridor.faults


def test_a_robot_creeps_where_its_lidar_does_not_look():
    corridor = Corridor(field_rad=math.pi, n_rays=181)
    corridor.run(2.0)
    assert corridor.speeds[0] == pytest.approx(1.2)
    corridor.run(1.0, Command(-1.0, 0.0))
    assert corridor.speeds[0] == pytest.approx(-0.1)
    assert "NOT_IN_VIEW" in corridor.faults


@pytest.mark.parametrize(("gap_m", "yaw_rad"), [(-0.1, 0.1), (-0.05, 0.3), (0.0, 0.1), (0.2, 0.3)])
def test_a_robot_beside_a_wall_moves_away_from_it_slowly_and_comes_no_nearer(gap_m, yaw_rad):
    right_m = -(RADIUS_M + gap_m)
    side = {"wall_m": 30.0, "sides_m": (right_m, 6.0)}
    corridor = Corridor(**side, start=(0.0, 0.0, yaw_rad)).run(1.0)
    assert corridor.speeds[0] <= 0.11 or gap_m >= 0.0
    corridor.run(14.0)
    assert corridor.pose[1] - right_m > RADIUS_M
    assert corridor.speeds[0] == pytest.approx(1.2)
    towards = Corridor(**side, start=(0.0, 0.0, -0.3 if gap_m else -1.5)).run(5.0)
    assert towards.pose[1] > -0.03 - max(gap_m, 0.0)


@pytest.mark.parametrize(
    ("twist", "start_m", "pose_tolerance"),
    [(0.0, 0.0, 0.5), (-1.0, 0.0, 0.15), (0.5, 0.0, 0.5), (1000.0, 0.0, 0.5), (0.0, 4.65, 0.5),
     (-1.0, 4.55, 0.15), (0.0, 4.35, 0.15), (-1.0, 4.15, 0.5)],
)  # fmt: skip
def test_a_twist_that_contradicts_the_pose_of_its_message_stands_the_robot(
    twist, start_m, pose_tolerance
):
    corridor = Corridor(wall_m=5.0, start=(start_m, 0.0, 0.0), pose_tolerance=pose_tolerance)
    corridor.twist = lambda speeds: (twist * speeds[0], speeds[1])
    corridor.run(8.0)
    assert corridor.pose[0] < 2.0 or start_m
    assert "TWIST" in corridor.faults or start_m
    corridor.twist = lambda speeds: speeds
    corridor.run(25.0)
    assert 0.0 < corridor.gap_m < 0.1
    assert "TWIST" not in {each.fault.name for each in corridor.outputs[-1].reasons} or start_m
    turning = Corridor()
    turning.twist = lambda speeds: (speeds[0], -speeds[1])
    assert turning.run(1.0, Command(0.0, 1.0)).outputs[-1].action is GuardAction.STOP
    assert "TWIST" in turning.faults


@pytest.mark.parametrize("degrees", [90, 170])
@pytest.mark.parametrize(
    "values",
    [
        (np.nan, np.inf),
        (17.0, np.inf),
        (np.inf, np.inf, np.nan, np.inf),
        tuple([np.inf, np.nan] * 100),
    ],
)
def test_a_sector_stays_lost_whatever_it_reads_but_returns(values, degrees):
    """One value scan by scan; the last one stays."""
    corridor, waiting = Corridor(), list(values)
    aside = np.abs(np.degrees(corridor.angles_rad)) < degrees / 2

    def change(ranges_m, x_m):
        if x_m <= 3.0:
            return ranges_m
        return np.where(aside, waiting.pop(0) if len(waiting) > 1 else waiting[0], ranges_m)

    corridor.change = change
    assert corridor.run().gap_m > 0.0


def test_a_sector_stays_lost_while_the_number_of_rays_changes():
    corridor = Corridor(n_rays=450)
    sizes = [450, 451, 452]

    def change(_, x_m):
        sizes.append(sizes.pop(0))
        other = Corridor(n_rays=sizes[0])
        corridor.geometry, other.pose = other.geometry, corridor.pose
        ranges_m = Corridor.ranges_m(other)
        ahead = np.abs(np.degrees(other.angles_rad)) < 45.0
        return np.where(ahead & (x_m > 3.0), np.inf, ranges_m)

    corridor.change = change
    assert corridor.run().gap_m > 0.5


@pytest.mark.parametrize("event", ["clock gap", "odometry jump", "clock falls back"])
def test_a_sector_stays_lost_after_a_session_has_begun(event):
    corridor = Corridor(wall_m=8.0).sector(np.inf, 90.0).run(8.0)
    before_m, now_s = corridor.pose[0], corridor.time_s
    if event == "odometry jump":
        corridor.guard.receive_odometry(now_s - 1e-3, (before_m - 5.0, 0.0, 0.0), (0.0, 0.0))
    else:
        corridor.time_s = now_s + 1.5 if event == "clock gap" else 0.0
    corridor.run(6.0)
    assert corridor.pose[0] < before_m + 0.5
    assert corridor.gap_m > 0.0


@pytest.mark.parametrize(
    ("range_max_m", "speed_mps", "braking_mps2"),
    [(3.5, 3.0, 1.0), (3.5, 2.0, 0.5), (0.6, 1.2, 2.5)],
)
def test_a_robot_drives_no_faster_than_it_can_stop_within_range_max(
    range_max_m, speed_mps, braking_mps2
):
    corridor = Corridor(
        wall_m=9.0, sides_m=(-9.0, 9.0), range_m=(0.1, range_max_m),
        acceleration_mps2=braking_mps2, max_vel_x=speed_mps,
    )  # fmt: skip
    corridor.run(30.0, Command(speed_mps, 0.0))
    assert 0.0 < corridor.gap_m < 1.0


@pytest.mark.parametrize("delay_ticks", [1, 4])
def test_a_twist_that_is_late_is_no_fault(delay_ticks):
    """As that of a filter; the robot stops and goes, and turns to and fro."""
    corridor, waiting = Corridor(wall_m=60.0, sides_m=(-9.0, 9.0)), []

    def late(speeds):
        waiting.append(speeds)
        return waiting[max(len(waiting) - 1 - delay_ticks, 0)]

    corridor.twist = late
    for number in range(8):
        corridor.run(1.0, AHEAD if number % 2 else Command(0.0, 0.8 * (-1) ** (number // 2)))
    assert "TWIST" not in corridor.faults


@pytest.mark.parametrize(("lidar_x_m", "degrees"), [(0.0, 90), (0.26, 60), (0.3, 60)])
def test_a_lidar_at_the_front_that_its_robot_covers_behind_drives(lidar_x_m, degrees):
    corridor = Corridor(lidar_x_m=lidar_x_m)
    corridor.sector(np.nan, degrees, after_m=-1.0, centre_deg=180.0).run()
    assert corridor.pose[0] > 5.0
    assert 0.0 < corridor.gap_m < 0.1


GEOMETRY = ScanGeometry(-math.pi, math.tau / 720, 0.1, 10.0)


def scan_of(*discs, background_m=8.0):
    """A scan of round bodies at (distance_m, bearing_rad) in front of a background."""
    ranges_m = np.full(720, background_m, dtype=np.float32)
    angle = GEOMETRY.angle_min_rad + GEOMETRY.angle_increment_rad * np.arange(720)
    for away_m, bearing in discs:
        aside = np.abs(np.remainder(angle - bearing + math.pi, math.tau) - math.pi)
        on_body = aside < math.asin(RADIUS_M / away_m)
        ranges_m[on_body] = np.minimum(ranges_m[on_body], away_m - RADIUS_M)
    return Scan(0.0, ranges_m, GEOMETRY)


def at(away_m, bearing):
    return [away_m * math.cos(bearing), away_m * math.sin(bearing)]


@pytest.mark.parametrize("bearing", [0.0, 1.0, math.pi, -math.pi + 0.01])
@pytest.mark.parametrize(
    ("body", "person_m", "counts"),
    [
        ((3.0, 0.0), 3.0, (1, 0)),
        ((3.3, 0.0), 3.0, (1, 0)),
        (None, 3.0, (0, 1)),
        ((3.0, 0.5), 3.0, (0, 1)),
        ((1.5, 0.0), 3.0, (0, 0)),  # who is hidden
        (None, 5.5, (0, 0)),
        (None, 0.4, (0, 0)),
    ],
)
def test_a_person_is_seen_unseen_or_in_no_view_of_a_scan(bearing, body, person_m, counts):
    scan = scan_of() if body is None else scan_of((body[0], bearing + body[1]))
    assert shown_by(scan, np.array([at(person_m, bearing)]), RADIUS_M) == counts
    assert shown_by(scan, np.zeros((0, 2)), RADIUS_M) == (0, 0)
    lost = replace(scan, ranges_m=np.full_like(scan.ranges_m, np.inf))
    assert shown_by(lost, np.array([at(3.0, bearing)]), RADIUS_M) == (0, 0)


SHORT = ScanGeometry(-math.pi, math.tau / 360, 0.12, 3.5)


def zeros_of(*changes):
    """Zeros of scans of a room with walls at 2 m, each changed by (rays, value) pairs."""
    zeros = ZeroRanges()
    for change in changes:
        ranges_m = np.full(360, 2.0, dtype=np.float32)
        for rays, value in change:
            ranges_m[rays] = value
        zeros.take(Scan(0.0, ranges_m, SHORT))
    return zeros


SIDES = slice(90, 100), slice(130, 140)
ZERO = slice(100, 130), 0.0


@pytest.mark.parametrize(
    ("change", "meaning"),
    [
        ([(slice(0, 360), 0.0)], "unknown"),
        ([(slice(0, 360), np.nan), ZERO], "unknown"),
        ([(slice(0, 360), -np.inf), ZERO], "unknown"),
        ([ZERO], "free"),
        ([ZERO, (slice(200, 210), np.inf)], "unknown"),
        ([ZERO, *((side, 0.2) for side in SIDES)], "obstacle"),
        ([ZERO, *((side, 1.0) for side in SIDES)], "unknown"),
        ([(slice(0, 360, 10), 0.0)], "unknown"),
        ([(slice(350, 360), 0.0), (slice(0, 10), 0.0)], "free"),
        ([(5, 0.0)], None),
        ([], None),
        ([(slice(0, 90), np.nan), (slice(90, 180), -np.inf)], None),
    ],
)
def test_zeros_are_recognised_by_what_stands_beside_them(change, meaning):
    assert zeros_of(change).seems_to_be == meaning
    assert zeros_of(*[change] * 5).seems_to_be == meaning


def test_the_sentence_names_what_to_set_where_it_is_set_otherwise():
    zeros = zeros_of([ZERO])
    assert zeros.share == pytest.approx(30 / 360)
    assert zeros.sentence("unknown") == (
        "8 % of the ranges are 0, which seems to mean no return; set zero_is to free if the manual"
        " of the lidar agrees, it is unknown"
    )
    assert zeros.sentence("free") == "8 % of the ranges are 0, which seems to mean no return"
    assert zeros_of([]).sentence("unknown") == ""
