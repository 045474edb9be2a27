"""Poses in frames that /tf joins with the map, and frames that nothing joins."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, PoseWithCovariance
from nav_msgs.msg import Odometry

from serd_bag.messages.plain import Header, Transform
from serd_core.grid.grid import Action
from serd_ros.convert.frames import Frames, NotYetError
from serd_ros.convert.motion import from_intent, from_odometry, to_intent, to_pose
from serd_ros.convert.sensors import from_people_message, to_people_message
from serd_ros.errors import MessageError
from serd_sim.safety.motion import compose
from serd_sim.world.observation import People

SECOND = 10**9


def transform(parent, child, x, y, yaw, *, stamp_ns=SECOND, roll=0.0):
    turn = (math.sin(roll / 2), 0.0, math.sin(yaw / 2), math.cos(yaw / 2) * math.cos(roll / 2))
    return Transform(Header(stamp_ns, parent), child, (x, y, 0.3, *turn))


@pytest.fixture
def frames():
    known = Frames()
    known.take(transform("map", "odom", 2.0, 1.0, math.pi / 2), static=False)
    known.take(transform("odom", "base_footprint", 3.0, 0.5, 0.2), static=False)
    known.take(transform("base_footprint", "base_link", 0.1, 0.0, 0.0), static=True)
    known.take(transform("base_link", "laser", 0.0, 0.0, 0.0, roll=math.pi), static=True)
    return known


def test_a_chain_of_frames_is_followed_and_its_stamp_is_that_of_the_motion(frames):
    frames.take(transform("odom", "base_footprint", 3.0, 0.5, 0.2, stamp_ns=5), static=False)
    placed = frames.place("base_link", "map")
    odom = compose((2.0, 1.0, math.pi / 2), (3.0, 0.5, 0.2))
    assert placed.pose == pytest.approx(compose(odom, (0.1, 0.0, 0.0)))
    assert placed.stamp_ns == 5
    back = frames.place("map", "base_link").pose
    assert compose(placed.pose, back) == pytest.approx((0.0, 0.0, 0.0))


def test_odometry_without_a_child_frame_is_refused_by_the_field_that_lacks_it(frames):
    message = Odometry(pose=PoseWithCovariance(pose=to_pose((3.0, 0.5, 0.2))))
    message.header.frame_id = "odom"
    with pytest.raises(MessageError, match=r"^child_frame_id must be 'base_link' .*set child_fr"):
        from_odometry(message, frames)


@pytest.mark.parametrize(
    ("roll", "sentence"),
    [
        (math.pi / 2, r"level in 'base_link', got 'laser'.* points elsewhere"),
        (math.pi, r"z axis points down; let the driver reverse the angles"),
    ],
)
def test_a_tilted_frame_is_refused_and_of_one_upside_down_the_angles_are_to_be_reversed(
    frames, roll, sentence
):
    frames.take(transform("base_link", "laser", 0.0, 0.0, 0.0, roll=roll), static=True)
    with pytest.raises(MessageError, match=sentence):
        frames.place("laser", "base_link")


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"child": "base_link"}, "between two frames, got 'base_link'"),
        ({"x": math.nan}, "transforms must be finite"),
        ({"x": 1.1e7}, "of at most 1e.07 m"),
        ({"roll": math.nan}, "with a unit quaternion"),
        ({"roll": 2.0, "yaw": 2.0}, "with a unit quaternion"),  # its length is 1.2
    ],
)
def test_a_transform_that_is_none_is_refused(frames, values, sentence):
    given = {"parent": "base_link", "child": "laser", "x": 1.0, "y": 0.0, "yaw": 0.0} | values
    with pytest.raises(MessageError, match=sentence):
        frames.take(transform(**given), static=False)


@pytest.mark.parametrize("is_static", [False, True])
def test_a_frame_with_two_parents_is_refused_until_it_has_had_one_for_a_while(frames, is_static):
    def at(seconds):
        return {"stamp_ns": SECOND + round(seconds * SECOND)}

    def odom(seconds):
        frames.take(transform("map", "odom", 2.0, 1.0, 0.0, **at(seconds)), static=False)
        moved = transform("odom", "base_footprint", 3.0, 0.5, 0.2, **at(seconds))
        frames.take(moved, static=False)

    def visual(seconds, *, static):
        other = transform("visual_odom", "base_footprint", 0.0, 0.0, 0.0, **at(seconds))
        frames.take(other, static=static)

    def assert_refused(sentence=""):
        with pytest.raises(MessageError, match=f"must have one parent{sentence}"):
            frames.place("base_link", "map")

    visual(0.1, static=is_static)
    odom(0.2)
    visual(0.25, static=False)
    assert_refused()  # the newest parent does not join them
    odom(0.3)
    assert_refused(", got 'base_footprint' in 'visual_odom' and in 'odom'; end what")
    odom(3.2)
    assert_refused()
    odom(3.4)
    assert frames.place("base_link", "map").stamp_ns == at(3.4)["stamp_ns"]


def moving(rate_hz, *, ahead_s=0.0, lasts_s=12.0):
    """Frames in which odom turns at 1 rad/s in the map, and the base drives at 1 m/s in odom."""
    known = Frames()
    for tick in range(round(lasts_s * rate_hz)):
        time_s = 100.0 + tick / rate_hz
        stamp = {"stamp_ns": round(time_s * SECOND)}
        known.take(transform("odom", "base_link", time_s - 100.0, 0.0, 0.0, **stamp), static=False)
        late = {"stamp_ns": round((time_s + ahead_s) * SECOND)}
        turned_rad = time_s + ahead_s - 100.0
        known.take(transform("map", "odom", 0.0, 0.0, turned_rad, **late), static=False)
    return known


def test_a_frame_is_placed_where_it_was_at_a_stamp():
    known = moving(20.0)
    for after_s in (2.5, 4.321, 11.9):
        x_m, y_m, yaw_rad = known.place("base_link", "map", at_ns=round((100 + after_s) * 1e9)).pose
        turned_rad = math.remainder(after_s, math.tau)
        expected = (after_s * math.cos(after_s), after_s * math.sin(after_s), turned_rad)
        assert (x_m, y_m, yaw_rad) == pytest.approx(expected, abs=1e-6)


def test_without_a_stamp_frames_are_placed_when_all_transforms_have_reached():
    """As tf2 does for time 0: a localisation that stamps ahead is interpolated, one that lags holds
    the pose back."""
    ahead, behind = moving(20.0, ahead_s=0.9), moving(20.0, ahead_s=-0.4)
    for known, after_s in ((ahead, 11.95), (behind, 11.55)):
        placed = known.place("base_link", "map")
        assert placed.stamp_ns == round((100 + after_s) * 1e9)
        assert math.hypot(*placed.pose[:2]) == pytest.approx(after_s, abs=1e-6)
        assert placed.pose[2] == pytest.approx(math.remainder(after_s, math.tau), abs=1e-6)


def test_transforms_are_not_extrapolated_beyond_what_is_kept():
    known = moving(20.0, lasts_s=25.0)
    with pytest.raises(NotYetError, match=r"must reach the stamp of a message, got 'odom' to 'bas"):
        known.place("base_link", "map", at_ns=125 * SECOND)
    with pytest.raises(MessageError, match=r"at most as old as /tf is kept \(10 s\), got one"):
        known.place("base_link", "map", at_ns=104 * SECOND)
    kept = known.place("base_link", "map", at_ns=round(114.96 * SECOND))
    assert math.hypot(*kept.pose[:2]) == pytest.approx(14.96, abs=1e-6)


def test_transforms_of_a_clock_that_falls_back_begin_anew():
    known = moving(20.0)
    for parent, child in (("map", "odom"), ("odom", "base_link")):
        known.take(transform(parent, child, 7.0, 0.0, 0.0, stamp_ns=SECOND), static=False)
    placed = known.place("base_link", "map")
    assert (placed.stamp_ns, placed.pose) == (SECOND, (14.0, 0.0, 0.0))


def test_a_transform_that_has_stopped_is_named(frames):
    later = transform("odom", "base_footprint", 3.0, 0.5, 0.2, stamp_ns=9 * SECOND)
    frames.take(later, static=False)
    with pytest.raises(MessageError, match=r"'map' to 'odom', 8\.0 s older"):
        frames.place("base_link", "map")


def test_a_loop_places_nothing_until_one_of_its_transforms_has_stopped(frames):
    before = frames.place("base_link", "map").pose
    frames.take(transform("base_link", "map", 0.0, 0.0, 0.0), static=False)
    with pytest.raises(MessageError, match="no loop, got 'base_link' in 'base_footprint' in 'odom"):
        frames.place("base_link", "map")
    later = 5 * SECOND
    frames.take(transform("odom", "base_footprint", 3.0, 0.5, 0.2, stamp_ns=later), static=False)
    frames.take(transform("map", "odom", 2.0, 1.0, math.pi / 2, stamp_ns=later), static=False)
    assert frames.place("base_link", "map").pose == before


def test_odometry_of_another_frame_of_the_robot_gives_the_motion_of_its_base(frames):
    message = Odometry(child_frame_id="base_footprint")
    message.header.frame_id = "odom"
    message.pose.pose = to_pose((3.0, 0.5, math.pi / 2))
    message.twist.twist.linear.x, message.twist.twist.angular.z = 0.4, 1.0
    _, pose, speeds = from_odometry(message, frames)
    assert pose == pytest.approx((3.0, 0.6, math.pi / 2))
    assert speeds == pytest.approx((0.4, 1.0))


def test_people_and_intents_are_turned_into_the_map(frames):
    people = People(np.array([[1.0, 0.0]]), np.array([[0.5, 0.0]]), np.array([7]))
    message = to_people_message(people, 1.0)
    message.header.frame_id = "odom"
    _, placed = from_people_message(message, frames)
    assert placed.position_m == pytest.approx(np.array([[2.0, 2.0]]))
    assert placed.velocity_mps == pytest.approx(np.array([[0.0, 0.5]]), abs=1e-9)
    intent = to_intent(Action.EAST, 1.0)
    intent.header.frame_id = "odom"
    assert from_intent(intent, frames)[1] == Action.NORTH


def test_the_prefix_of_a_robot_is_added_to_its_own_frames_and_removed_from_all():
    frames = Frames("robot1/")
    odometry, pose = Odometry(child_frame_id="base_link"), PoseStamped()
    odometry.header.frame_id, pose.header.frame_id = "odom", "map"
    frames.prefixed(odometry)
    frames.prefixed(odometry)  # a message that is published again keeps one prefix
    frames.prefixed(pose)
    found = odometry.header.frame_id, odometry.child_frame_id
    assert found == ("robot1/odom", "robot1/base_link")
    assert pose.header.frame_id == "map"
    odometry.pose.pose.orientation.w = 1.0
    frames.remove_prefix(odometry)
    assert from_odometry(odometry, frames)[1] == (0.0, 0.0, 0.0)


def test_on_one_tf_a_robot_is_placed_by_its_own_frames():
    frames = Frames("robot1/")
    for robot, x_m in (("robot1", 1.0), ("robot2", 2.0)):
        for parent, child in (("map", f"{robot}/odom"), (f"{robot}/odom", f"{robot}/base_link")):
            frames.take(transform(parent, child, x_m, 0.0, 0.0), static=False)
    assert frames.place("base_link", "map").pose == (2.0, 0.0, 0.0)
    assert frames.place("robot1/base_link", "map").pose == (2.0, 0.0, 0.0)
    assert frames.place("robot2/base_link", "map").pose == (4.0, 0.0, 0.0)
