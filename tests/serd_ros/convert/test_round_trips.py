"""Every conversion to a message and back gives what went in, or the nearest the message carries."""

import math
from copy import deepcopy
from functools import reduce

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import LaserScan

from serd_app.drives.drive import EpisodeMark
from serd_bag.formats.rosbag2.message_types import rosbags_types
from serd_core.arrival.law import ArrivalLaw
from serd_core.grid.grid import Action
from serd_ros.convert import diagnostics, motion, sensors, typed
from serd_ros.convert import stamp as stamps
from serd_ros.errors import MessageError
from serd_sim.scenario.occupancy import OccupancyRaster
from serd_sim.scenario.settings import LidarSettings
from serd_sim.world.command import Command
from serd_sim.world.observation import ObservationInbox, People
from serd_sim.world.waypoint import Waypoint
from support.observations import observation_at

ODOMETRY = motion.to_odometry(observation_at(1.0, 2.0, 0.3), (1.0, 2.0, 0.3))
SCAN = sensors.to_scan(np.ones(360, dtype=np.float32), LidarSettings(), 0.1)
metres = st.floats(-1e3, 1e3, allow_nan=False)
angles = st.floats(-3.1415, 3.1415)


@given(tick=st.integers(0, 7 * 24 * 3600 * 20))
def test_a_stamp_keeps_a_tick_of_a_simulated_week_to_the_nanosecond(tick):
    stamp = stamps.to_stamp(tick * 0.05)
    assert stamps.stamp_ns(stamp) == tick * 50_000_000
    assert stamps.stamp_s(stamp) == pytest.approx(tick * 0.05, abs=1e-9)


@given(x=metres, y=metres, yaw=angles)
def test_a_pose_keeps_its_position_exactly_and_its_yaw_to_rounding(x, y, yaw):
    back = motion.from_pose(motion.to_pose((x, y, yaw)))
    assert back[:2] == (x, y)
    assert back[2] == pytest.approx(yaw, abs=1e-12)


@given(x=metres, y=metres)
def test_waypoints_commands_and_intents_survive_exactly(x, y):
    at_ns = 1_500_000_000
    waypoint, command = Waypoint(x, y), Command(x, y)
    message = motion.to_waypoint_message(waypoint, 1.5)
    assert motion.from_waypoint_message(message)[:2] == (at_ns, waypoint)
    assert motion.from_twist(motion.to_twist(command)) == command
    stamped = motion.to_twist_stamped(command, 1.5)
    assert motion.from_twist_stamped(stamped) == (at_ns, command)
    for action in Action:
        assert motion.from_intent(motion.to_intent(action, 1.5)) == (at_ns, action)


@pytest.mark.parametrize("wrong", [math.nan, -math.inf, 1.1e6, -1e300])
def test_a_command_that_is_not_finite_or_beyond_1e6_arrives_not_finite(wrong):
    assert not motion.from_twist(motion.to_twist(Command(wrong, 0.0))).is_finite
    assert not motion.from_twist(motion.to_twist(Command(0.0, wrong))).is_finite


@given(st.lists(st.tuples(metres, metres, metres, metres), max_size=30))
def test_people_survive_in_single_precision(rows):
    values = np.array(rows, dtype=np.float32).astype(float).reshape(-1, 4)
    people = People(values[:, :2], values[:, 2:], np.arange(len(values)))
    _, back = sensors.from_people_message(sensors.to_people_message(people, 0.0))
    assert np.array_equal(back.position_m, people.position_m)
    assert np.array_equal(back.velocity_mps, people.velocity_mps)
    assert np.array_equal(back.identity, people.identity)


POSE = motion.to_pose_stamped((1.0, 2.0, 0.3), 0.5)
BROKEN = [
    (motion.from_pose_stamped, POSE, "pose.position.x", "position must"),
    (motion.from_pose_stamped, POSE, "pose.orientation.z", "unit quatern"),
    (motion.from_odometry, ODOMETRY, "pose.pose.position.y", "position must"),
    (motion.from_odometry, ODOMETRY, "pose.pose.orientation.w", "unit quaternion"),
    (motion.from_odometry, ODOMETRY, "twist.twist.linear.x", "twist must be finite and at most"),
    (motion.from_odometry, ODOMETRY, "twist.twist.angular.z", "twist must be finite and at most"),
    (sensors.from_scan, SCAN, "range_min", "range_min and range_max must be finite"),
    (sensors.from_scan, SCAN, "range_max", "range_min and range_max must be finite"),
]


@pytest.mark.parametrize(("convert", "sound", "field", "sentence"), BROKEN)
def test_a_number_that_is_none_is_refused_by_its_field(convert, sound, field, sentence):
    message = deepcopy(sound)
    convert(message)
    *parts, name = field.split(".")
    setattr(reduce(getattr, parts, message), name, math.nan)
    with pytest.raises(MessageError, match=f"{sentence}.*nan"):
        convert(message)


@pytest.mark.parametrize("limits", [(0.0, 0.0), (20.0, 10.0), (-1.0, 10.0)])
def test_a_scan_that_has_no_valid_range_is_rejected_where_ranges_are_read(limits):
    message = deepcopy(SCAN)
    message.range_min, message.range_max = limits
    with pytest.raises(MessageError, match=r"range_max must be above range_min.*set both in the"):
        sensors.scan_geometry_of(message)


@given(x=metres, y=metres, yaw=angles, v=metres, w=metres, tick=st.integers(0, 10**7))
def test_an_observation_survives_the_three_topics_bit_for_bit(x, y, yaw, v, w, tick):
    sent = observation_at(
        x, y, yaw, tick=tick, speed_mps=v, yaw_rate_radps=w, people=[[x, y], [1.1, 2.2]],
        velocity=[[0.1, 0.2], [v, w]],
    )  # fmt: skip
    inbox = ObservationInbox(0.05)
    people = sensors.to_people_message(sent.people, sent.time_s)
    inbox.take_people(*sensors.from_people_message(people))
    of_wheels = 5.0, 6.0, 0.7  # which are not where the robot is
    time_ns, pose, speeds = motion.from_odometry(motion.to_odometry(sent, of_wheels))
    assert pose == pytest.approx(of_wheels)
    assert inbox.take_speeds(time_ns, speeds) is None
    message = motion.to_pose_stamped(sent.pose, sent.time_s)
    got = inbox.take_pose(*motion.from_pose_stamped(message))
    assert (got.tick, got.pose, got.speed_mps, got.yaw_rate_radps) == (tick, sent.pose, v, w)
    assert np.array_equal(got.people_position_m, sent.people_position_m)
    assert np.array_equal(got.people_velocity_mps, sent.people_velocity_mps)


def test_a_scan_keeps_its_ranges_and_its_geometry():
    settings = LidarSettings()
    ranges = np.linspace(0.2, 9.0, settings.n_rays).astype(np.float32)
    ranges[3] = np.inf
    message = sensors.to_scan(ranges, settings, 0.1)
    time_ns, received = sensors.from_scan(message, settings)
    assert time_ns == 100_000_000
    assert np.array_equal(received, ranges)
    last_rad = message.angle_min + (settings.n_rays - 1) * message.angle_increment
    assert last_rad == pytest.approx(message.angle_max, abs=1e-5)


@pytest.mark.parametrize(
    ("first_rad", "last_rad", "step_rad", "n_rays"),
    [
        pytest.param(0.0, 6.28318548203, 0.0174532923847, 360, id="lidar of the TurtleBot3"),
        pytest.param(-math.pi, math.pi, math.pi / 360, 720, id="pointcloud_to_laserscan"),
        pytest.param(math.pi, -math.pi, -math.pi / 360, 720, id="clockwise"),
    ],
)
def test_angle_max_may_be_the_end_of_the_turn_after_the_last_ray(
    first_rad, last_rad, step_rad, n_rays
):
    message = LaserScan(
        angle_min=first_rad, angle_max=last_rad, angle_increment=step_rad, ranges=[1.0] * n_rays
    )
    message.header.frame_id = "base_link"
    assert len(sensors.from_scan(message)[1]) == n_rays
    for factor, sentence in ((1, "one ray per angle_increment"), (300, "at most 72000 rays, got")):
        message.ranges = message.ranges[:-1] * factor
        with pytest.raises(MessageError, match=sentence):
            sensors.from_scan(message)


def test_a_map_keeps_its_cells_row_by_row_from_the_south():
    cells = np.array([[0, 100, -1], [100, 0, 0]], dtype=np.int8)
    message = sensors.to_occupancy_grid(OccupancyRaster((1.0, -2.0), 0.05, cells), 0.0)
    assert (message.info.width, message.info.height) == (3, 2)
    assert list(message.data) == [0, 100, -1, 100, 0, 0]
    assert (message.info.origin.position.x, message.info.origin.position.y) == (1.0, -2.0)


def test_an_episode_mark_and_values_of_diagnostics_survive():
    mark = EpisodeMark("end", 12.35, 4, "strategy", 3, "train", "aborted", "no progress")
    assert diagnostics.from_episode_message(diagnostics.to_episode_message(mark)) == mark
    message = diagnostics.to_diagnostics("hallway_sim", 1.0, {"gap_m": 0.1 + 0.2, "count": 3})
    values = diagnostics.values_of(message, "hallway_sim")
    assert (float(values["gap_m"]), int(values["count"])) == (0.1 + 0.2, 3)
    assert diagnostics.values_of(message, "other") is None


def test_markers_show_the_arrows_of_a_policy_values_and_a_text():
    centers = np.array([[0.5, 0.5], [1.5, 0.5]])
    arrows = motion.to_policy_markers(centers, [Action.WAIT, Action.NORTH], 1.0, 7.5).markers
    assert [arrow.id for arrow in arrows] == [0, 1]
    assert stamps.stamp_s(arrows[0].header.stamp) == 7.5
    assert motion.from_pose(arrows[1].pose)[2] == pytest.approx(math.pi / 2)
    for value in (np.array([0.0, 5.0]), np.array([3.0, 3.0])):
        (cells,) = motion.to_value_markers(centers, value, 1.0, 0.0).markers
        assert [(each.x, each.y) for each in cells.points] == [(0.5, 0.5), (1.5, 0.5)]
        assert (cells.colors[0].r > cells.colors[1].r) == (value[0] < value[1])
    (words,) = motion.to_text_marker("arrives in 31 s", (2.5, 4.0), 3.0).markers
    assert (words.text, words.pose.position.x) == ("arrives in 31 s", 2.5)


@given(now_s=st.floats(0.0, 1e6), shares=st.lists(st.floats(0.002, 1.0), min_size=1, max_size=30))
def test_an_arrival_law_survives_with_its_time(now_s, shares):
    cdf = np.cumsum(shares) / max(1.0, float(np.sum(shares)))
    kept = np.diff(cdf, prepend=0.0) >= 1.1e-3
    cdf = np.concatenate([[0.0], cdf[kept]])
    law = ArrivalLaw(np.arange(len(cdf)) * 0.5, cdf, float(cdf[-1]))
    data = typed.to_arrival_forecast(
        law, now_s, elapsed_s=1.0, area_m=[(2.0, 3.0)], deadline_s=1.0, shares=(0.5,)
    )
    message = rosbags_types().deserialize_cdr(data, "serd_msgs/msg/ArrivalForecast")
    assert stamps.stamp_ns(message.header.stamp) == stamps.stamp_ns(stamps.to_stamp(now_s))
    assert (message.probability, message.goal.y) == (law.probability_by(1.0), 3.0)
    median_s = law.quantile_s(0.5)
    assert message.quantiles[0] == median_s or (median_s is None and np.isnan(message.quantiles[0]))
    assert message.mean == pytest.approx(0.5 * (1.0 - law.cdf[:-1]).sum())
    back = ArrivalLaw(message.times, message.probabilities, float(message.probabilities[-1]))
    asked = np.linspace(0.25, 20.25, 41)
    expected = law.probability_by(asked)
    np.testing.assert_allclose(back.probability_by(asked), expected, atol=1e-3 + 1e-9)


def test_the_next_start_of_a_learner_survives_and_must_be_a_place():
    def received(node="learner", **values):
        message = diagnostics.to_diagnostics(node, 0.0, values)
        return diagnostics.from_learner_report(message)

    assert received(next_x_m=1.5, next_y_m=-0.25) == (1.5, -0.25)
    assert received(step=3) is received("guard", next_x_m=1.0) is None
    for sentence, values in (
        ("must have the key next_y_m", {"next_x_m": 1.0}),
        ("next_x_m must be a number", {"next_x_m": "x", "next_y_m": 0.0}),
        ("must be finite", {"next_x_m": 1.0, "next_y_m": math.nan}),
    ):
        with pytest.raises(MessageError, match=sentence):
            received(**values)


def test_the_goal_area_survives_in_single_precision_and_the_own_one_exactly():
    own = ((0.1, 0.2), (1.1, 0.2), (1.1, 1.2))
    assert motion.from_goal_area_message(motion.to_goal_area_message(own, 2.0), own) is own
    other = ((0.5, 2.0), (1.5, 2.0), (1.5, 3.0), (0.5, 3.0))
    message = motion.to_goal_area_message(other, 2.0)
    assert motion.from_goal_area_message(message, own) == other
    assert message.header.frame_id == "map"
