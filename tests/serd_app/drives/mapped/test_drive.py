"""Bags of other robots by a mapping file: frames, clocks, inferred actions, a fitted grid."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_app.demonstrations.discretise import NO_COMMAND, decisions_from_drive
from serd_app.demonstrations.grid.fitted_grid import grid_around
from serd_app.drives.episode_spans import EpisodeSpan
from serd_app.drives.mapped.actions import (
    PoseTrack,
    actions_of_waypoints,
    hidden_intents,
    intents_of_velocities,
    posed_intents,
)
from serd_app.drives.mapped.drive import mapped_drive_in
from serd_app.drives.mapped.mapping import BagMapping
from serd_app.drives.recorded_drive import NOT_FINITE, SILENCE
from serd_app.drives.sessions import read_drives
from serd_app.drives.transforms import Poses, TransformTree
from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import message_type, typestore_of
from serd_bag.messages.fields import messages_of
from serd_bag.messages.plain import Header, Transform
from serd_bag.reader import BagReader
from serd_core.grid.grid import Action
from serd_files.yaml_config import yaml_model
from support.bag_messages import OWN_TOPICS, POSE, TF, TWIST, VECTOR, write_bag

REAL_BAG = Path(__file__).parents[4].parent / "shared" / "data" / "bags" / "test-bag"
number = st.floats(-10, 10)
pose_of_numbers = st.tuples(number, number, number)


def transform(parent, child, time_s, x, y, yaw):
    header = Header(round(time_s * 1e9), parent)
    turned = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    return Transform(header, child, (x, y, 0.0, *turned))


SPAN = EpisodeSpan(0, 0.0, 4.0, "arrived")


def velocity_actions(commands, yaw_rad=0.0, hold_s=0.5, span=SPAN, pose_time_s=(0.0, 4.0), **more):
    """(time, action) of the intents that commands (time, forward, left) mean."""
    rows = np.array(commands, dtype=float).reshape(-1, 3)
    found = intents_of_velocities(
        (span,),
        command_time_s=rows[:, 0],
        command_mps=rows[:, 1:],
        pose_time_s=np.array(pose_time_s),
        yaw_rad=np.broadcast_to(yaw_rad, len(pose_time_s)),
        hold_s=hold_s,
        **more,
    )
    assert found.hold_s == math.inf
    return list(zip(found.time_s.round(6).tolist(), found.action.tolist(), strict=True))


def test_a_command_that_is_held_through_a_turn_means_the_heading_of_the_next_second():
    """It turns by a quarter in 2 s: through north-east at 1 s, which is the middle of a second that
    begins at 0.5 s."""
    time_s = np.arange(0.0, 8.01, 0.1)
    actions = velocity_actions(
        [(0.0, 0.5, 0.0)],
        yaw_rad=np.pi / 4.0 * time_s,
        hold_s=10.0,
        span=EpisodeSpan(0, 0.0, 8.0, "arrived"),
        pose_time_s=time_s,
    )
    assert [action for _, action in actions] == [
        Action.EAST,
        Action.NORTH,
        Action.WEST,
        Action.SOUTH,
        Action.EAST,
    ]
    at_s = [time_s for time_s, _ in actions]
    np.testing.assert_allclose(at_s, [0.0, 0.5, 2.5, 4.5, 6.5], atol=0.11)


def test_velocity_commands_mean_the_direction_they_drive_to():
    steady = [(0.1 * tick, 0.5, 0.0) for tick in range(41)]
    assert velocity_actions(steady) == [(0.0, Action.EAST)]
    assert velocity_actions(steady, math.pi / 2) == [(0.0, Action.NORTH)]
    assert velocity_actions(steady, math.pi) == [(0.0, Action.WEST)]
    backwards = [(time_s, -speed, left) for time_s, speed, left in steady]
    assert velocity_actions(backwards) == [(0.0, Action.WEST)]


def test_a_command_that_is_not_repeated_ends_after_its_hold_time():
    assert velocity_actions([(0.0, 0.5, 0.0)]) == [(0.0, Action.EAST), (0.5, SILENCE)]
    assert velocity_actions([(0.0, 0.5, 0.0)], hold_s=math.inf) == [(0.0, Action.EAST)]
    waiting = velocity_actions([(1.0, 0.5, 0.0)], waits_in_silence=True)
    assert [action for _, action in waiting] == [Action.WAIT, Action.EAST, Action.WAIT]


def test_where_no_command_holds_nobody_decided_to_wait():
    assert velocity_actions([]) == [(0.0, SILENCE)]
    stopped = velocity_actions([(2.0, 0.0, 0.0)])
    assert stopped == [(0.0, SILENCE), (2.0, Action.WAIT), (2.5, SILENCE)]
    assert velocity_actions([(-0.5, 0.5, 0.0), (4.0, 0.5, 0.0)]) == [(0.0, SILENCE)]


def test_each_episode_has_an_intent_at_its_start():
    spans = SPAN, EpisodeSpan(1, 4.0, 6.0, "arrived")
    assert hidden_intents(spans).time_s.tolist() == [0.0, 4.0]
    track = PoseTrack(*[np.array([0.0, 6.0])] * 2, np.array([[0.0, 0.0, 0.0], [6.0, 0.0, 0.0]]))
    moving = posed_intents(BagMapping(action_from="motion"), track, spans)
    assert moving.time_s.tolist() == [0.0, 4.0]
    assert moving.action.tolist() == [Action.EAST] * 2
    assert len(posed_intents(BagMapping(action_from="motion"), track, ()).time_s) == 0


def test_waypoints_mean_the_direction_to_them():
    actions = actions_of_waypoints(
        position_m=np.zeros((3, 2)),
        waypoint_m=np.array([[1.0, 0.2], [0.1, -0.8], [0.1, 0.1]]),
        reached_m=0.25,
    )
    assert actions.tolist() == [Action.EAST, Action.SOUTH, Action.WAIT]


@given(pose_of_numbers, pose_of_numbers)
def test_a_transform_and_its_inverse_cancel(outer, inner):
    outer, inner = Poses.of_numbers(np.array([outer])), Poses.of_numbers(np.array([inner]))
    back = outer.inverse @ (outer @ inner)
    np.testing.assert_allclose(back.position_m, inner.position_m, atol=1e-9)
    np.testing.assert_allclose(back.rotation.as_matrix(), inner.rotation.as_matrix(), atol=1e-9)


def test_poses_go_through_a_moving_and_a_static_frame():
    tree = TransformTree()
    tree.add(transform("map", "odom", 0.0, 1.0, 0.0, 0.0), static=False)
    tree.add(transform("map", "odom", 2.0, 1.0, 2.0, math.pi / 2), static=False)
    tree.add(transform("map", "other", 0.0, 0.0, 5.0, 0.0), static=True)
    numbers, times_s = np.array([[1.0, 0.0, 0.0]] * 2), np.array([0.0, 2.0])
    poses = Poses.of_numbers(numbers)
    into_map = tree.into("map", "odom", poses, times_s)
    np.testing.assert_allclose(
        into_map.planar, [[2.0, 0.0, 0.0], [1.0, 3.0, math.pi / 2]], atol=1e-12
    )
    into_other = tree.into("other", "odom", poses, times_s)
    np.testing.assert_allclose(into_other.position_m[:, :2], [[2, -5], [1, -2]], atol=1e-12)
    back = tree.into("odom", "map", into_map, times_s)
    np.testing.assert_allclose(back.planar, numbers, atol=1e-12)


def test_a_camera_that_looks_forward_is_placed_in_space_not_in_the_plane():
    """Its optical frame has z forward and x to the right: 1 m ahead of a robot that looks north."""
    tree = TransformTree()
    tree.add(transform("map", "base", 0.0, 2.0, 3.0, math.pi / 2), static=True)
    optical = (-0.5, 0.5, -0.5, 0.5)
    tree.add(Transform(Header(0, "base"), "optical", (0.0, 0.0, 0.5, *optical)), static=True)
    ahead = Poses.of_numbers(np.array([[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]]))
    placed = tree.into("map", "optical", ahead, np.zeros(1))
    np.testing.assert_allclose(placed.position_m, [[2.0, 4.0, 0.5]], atol=1e-12)


@given(st.lists(st.tuples(number, number), min_size=1, max_size=20))
def test_a_fitted_grid_holds_every_position(places):
    grid = grid_around(np.array(places), 0.5)
    assert (grid.states_at(places) >= 0).all()


KINDS = {"/pose": POSE, "/cmd_vel": TWIST, "/tf": TF}
DRIVEN = BagMapping(pose_topic="/pose", action_from="velocity", action_topic="/cmd_vel")


def tf(messages, time_s, x):
    """odom at x in the map."""
    return messages.transform(time_s, "map", "odom", x, 0.0)


def written(path, kinds, *rows):
    """A bag of messages (topic, time, bytes) in the order of time."""
    return BagReader(write_bag(path, kinds, sorted(rows, key=lambda row: row[1])))


@pytest.fixture
def foreign_bag(tmp_path, messages):
    """A robot that looks north and drives so, in a frame 10 m off the map, at ten times real time:
    stamps are simulated time, log times wall time, velocity commands have no stamp."""
    rows = []
    for tick in range(81):
        time_s, log_s = 50.0 + 0.1 * tick, 1e9 + 0.01 * tick
        pose = messages.pose(time_s, 0.5, 0.5 + 0.05 * tick, frame="odom")
        rows += [("/tf", log_s, tf(messages, time_s, 10.0)), ("/robot/pose", log_s, pose)]
        if tick < 40:
            rows.append(("/robot/cmd_vel", log_s, messages.twist(0.5)))
    kinds = {"/robot/pose": POSE, "/robot/cmd_vel": TWIST, "/tf": TF}
    return BagReader(write_bag(tmp_path / "foreign", kinds, rows))


def drive_with_tf(path, messages, tf_times_s):
    """The drive in the map of poses in odom, which /tf joins at these times."""
    rows = [("/tf", time_s, tf(messages, time_s, 10.0)) for time_s in tf_times_s]
    for time_s in 50.0 + 0.1 * np.arange(81):
        pose = messages.pose(time_s, 0.5, 0.5 * (time_s - 49.0), frame="odom")
        rows += [("/pose", time_s, pose), ("/cmd_vel", time_s, messages.twist(0.5))]
    mapping = DRIVEN.model_copy(update={"frame": "map"})
    return mapped_drive_in(written(path, KINDS, *rows), mapping)


def test_poses_that_no_transform_reaches_are_left_out_and_counted(tmp_path, messages):
    drive = drive_with_tf(tmp_path / "late", messages, np.arange(53.0, 56.01, 0.5))
    assert drive.n_unplaced_poses == 20 + 10
    assert (drive.pose_time_s[0], drive.pose_time_s[-1]) == pytest.approx((52.0, 57.0))
    np.testing.assert_allclose(drive.position_m[:, 0], 10.5)
    _, report = decisions_from_drive(drive, grid_around(drive.position_m, 0.5), 4.0, 1.0)
    assert report.n_unplaced_poses == 30


def test_transforms_of_another_clock_place_no_pose_and_that_is_said(tmp_path, messages):
    with pytest.raises(BagError, match=r"/tf must join 'odom' with 'map' .* at least once; record"):
        drive_with_tf(tmp_path / "other", messages, np.arange(0.0, 3.0, 0.5))


def drive_east(messages, frame="map", seconds=8.0, step_s=0.1):
    """Rows of poses of a robot that drives along x from 0 at 1 m/s, and of its commands."""
    for time_s in np.arange(0.0, seconds + 1e-9, step_s) + 50.0:
        yield "/pose", time_s, messages.pose(time_s, time_s - 50.0, 0.5, frame=frame)
        yield "/cmd_vel", time_s, messages.twist(0.5)


@pytest.mark.parametrize(
    ("kind", "field", "states"),
    [
        ("std_msgs/msg/Empty", "", [0]),
        ("std_msgs/msg/Bool", "data", [False, True, True, False]),
        ("sensor_msgs/msg/Joy", "buttons.1", [[1, 0], [0, 1], [0, 1], [0, 0]]),
    ],
)
def test_each_press_of_a_button_ends_an_episode(tmp_path, messages, kind, field, states):
    def made(state):
        if not kind.endswith("Joy"):
            return messages.make(kind, state)
        axes, buttons = np.zeros(0, dtype=np.float32), np.array(state, dtype=np.int32)
        return messages.make(kind, messages.header(0.0), axes, buttons)

    at_s = 53.0 - 0.1 * (len(states) > 1)
    rows = [
        ("/button", at_s + 0.1 * number, messages.encode(made(each), kind))
        for number, each in enumerate(states)
    ]
    bag = written(tmp_path / "bag", KINDS | {"/button": kind}, *drive_east(messages), *rows)
    mapping = DRIVEN.model_copy(update={"button_topic": "button", "button_field": field})
    drive = mapped_drive_in(bag, mapping)
    assert [(each.start_s, each.end_s) for each in drive.episodes] == [
        (50.0, pytest.approx(53.0)),
        (pytest.approx(53.0), 58.0),
    ]
    assert drive.cuts == {"button": 1}


def test_poses_given_in_several_frames_are_each_brought_from_their_own(tmp_path, messages):
    rows = [*drive_east(messages, "odom")]
    rows += [("/tf", 50.0 + tick, tf(messages, 50.0 + tick, 10.0)) for tick in range(9)]
    in_map = [
        (topic, time_s, messages.pose(time_s, 10.0 + time_s - 50.0, 0.5))
        if topic == "/pose" and time_s > 55.0
        else (topic, time_s, data)
        for topic, time_s, data in rows
    ]
    mapping = DRIVEN.model_copy(update={"frame": "map"})
    one = mapped_drive_in(written(tmp_path / "one", KINDS, *rows), mapping)
    mixed = written(tmp_path / "two", KINDS, *in_map)
    two = mapped_drive_in(mixed, mapping)
    np.testing.assert_allclose(one.position_m, two.position_m, atol=1e-9)
    np.testing.assert_allclose(two.position_m[[0, -1], 0], [10.0, 18.0])
    assert one.intent_action.tolist() == two.intent_action.tolist()
    with pytest.raises(BagError, match="in one frame where the mapping names none, got 'odom', 'm"):
        mapped_drive_in(mixed, DRIVEN)


def test_a_topic_of_actions_without_a_message_is_refused(tmp_path, messages):
    poses = [row for row in drive_east(messages) if row[0] == "/pose"]
    silent = written(tmp_path / "silent", KINDS, *poses)
    with pytest.raises(BagError, match="action_topic /cmd_vel must hold messages, it holds none"):
        mapped_drive_in(silent, DRIVEN)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_command_that_is_not_finite_is_left_out_and_counted(tmp_path, messages, bad):
    rows = [*drive_east(messages)]
    sound = mapped_drive_in(written(tmp_path / "sound", KINDS, *rows), DRIVEN)
    rows.append(("/cmd_vel", 53.05, messages.twist(bad)))
    drive = mapped_drive_in(written(tmp_path / "bad", KINDS, *rows), DRIVEN)
    assert (sound.n_bad_commands, drive.n_bad_commands) == (0, 1)
    assert drive.intent_action.tolist() == sound.intent_action.tolist()
    _, report = decisions_from_drive(drive, grid_around(drive.position_m, 1.0), 4.0, 1.0)
    assert str(report).endswith("; 1 commands not finite")


def test_an_intent_or_waypoint_that_is_not_finite_is_dropped_and_counted(tmp_path, messages):
    poses = [row for row in drive_east(messages) if row[0] == "/pose"]
    for kind, source in ((VECTOR, "intent"), (POSE, "waypoint")):
        make = messages.intent if source == "intent" else messages.pose
        wishes = [("/wish", 50.0 + 2 * n, make(50.0 + 2 * n, 99.0, 0.5)) for n in range(3)]
        wishes[1] = ("/wish", 52.0, make(52.0, np.nan, 0.5))
        bag = written(tmp_path / source, KINDS | {"/wish": kind}, *poses, *wishes)
        mapping = BagMapping(pose_topic="/pose", action_from=source, action_topic="/wish")
        drive = mapped_drive_in(bag, mapping)
        assert drive.dropped == {NOT_FINITE: 1}
        assert drive.intent_time_s.tolist() == [50.0, 54.0]
        assert drive.intent_action.tolist() == [Action.EAST, Action.EAST]


def test_an_intent_that_was_sent_again_is_one(tmp_path, messages):
    poses = [row for row in drive_east(messages) if row[0] == "/pose"]
    times_s = (50.0, 50.0, 50.0, 52.0, 54.0, 54.0)
    wishes = [("/wish", time_s, messages.intent(time_s, 1.0, 0.0)) for time_s in times_s]
    bag = written(tmp_path / "again", KINDS | {"/wish": VECTOR}, *poses, *wishes)
    mapping = BagMapping(pose_topic="/pose", action_from="intent", action_topic="/wish")
    drive = mapped_drive_in(bag, mapping)
    assert drive.intent_time_s.tolist() == [50.0, 52.0, 54.0]


@pytest.mark.parametrize(
    ("step_s", "gap_s", "n_episodes"), [(0.1, 0.6, 2), (0.2, 0.9, 1), (0.2, 1.2, 2)]
)
def test_what_counts_as_a_gap_follows_how_often_poses_come(
    tmp_path, messages, step_s, gap_s, n_episodes
):
    rows = [
        (topic, time_s, data)
        for topic, time_s, data in drive_east(messages, step_s=step_s)
        if topic != "/pose" or not 54.05 < time_s < 54.0 + gap_s - 0.05
    ]
    bag = written(tmp_path / "gap", KINDS, *rows)
    drive = mapped_drive_in(bag, DRIVEN)
    assert drive.longest_gap_s == pytest.approx(max(0.5, 5 * step_s))
    assert len(drive.episodes) == n_episodes
    given = DRIVEN.model_copy(update={"longest_gap_s": 0.3})
    assert len(mapped_drive_in(bag, given).episodes) == 2


@pytest.mark.parametrize("far_m", [3e4, 1e6, 1e300, -1.7e308])
def test_a_pose_far_from_the_others_is_named_and_no_grid_fitted(far_m):
    places = np.array([[1.0, 2.0], [1.5, 2.0], [far_m, -far_m], [2.0, 2.0]])
    farthest = f"must have at most 4000000 cells, .* the pose ({far_m:g}, {-far_m:g}) m lies"
    with pytest.raises(BagError, match=re.escape(farthest).replace(r"\.\*", ".*")):
        grid_around(places, 0.5)


SET_BACK = r"that of pose 41 does by .* a clock was set back"


@pytest.mark.parametrize(
    ("topic", "log_times", "at", "back_s", "sentence"),
    [
        ("/pose", "wall", 36, 0.85, ""),
        ("/pose", "wall", 36, 3.0, r"that of pose 36 does by 2\.9 s: the world was started"),
        ("/pose", "stamps", 41, 3.02, SET_BACK),
        ("/pose", "stamps", 41, 4.0, SET_BACK),
        ("/pose", "stamps", 41, 60.0, ""),
        ("/tf", "stamps", 41, 4.0, SET_BACK),
        ("/tf", "receipt", 41, 4.0, SET_BACK),
    ],
)
def test_poses_of_two_runs_of_a_clock_are_never_mixed(
    tmp_path, messages, topic, log_times, at, back_s, sentence
):
    """A step back of less than a second is one of stamps alone; runs that do not overlap are put
    in order, as split files are."""
    rows = []
    for tick in range(80):
        time_s = 100.0 + 0.1 * tick - (back_s if tick >= at - 1 else 0.0)
        log_s = {"wall": 0.1 * tick, "stamps": time_s, "receipt": 100.0 + 0.1 * tick}[log_times]
        pose = messages.pose(time_s, 0.5, 0.1 * tick)
        moved = tf(messages, time_s, 0.1 * tick)
        rows.append((topic, log_s, pose if topic == "/pose" else moved))
    bag = BagReader(write_bag(tmp_path / "two", KINDS, rows))
    frames = {"frame": "map", "robot_frame": "odom"} if topic == "/tf" else {}
    mapping = BagMapping(pose_topic=topic, action_from="hidden", **frames)
    if sentence:
        with pytest.raises(BagError, match=sentence):
            mapped_drive_in(bag, mapping)
    else:
        assert len(mapped_drive_in(bag, mapping).pose_time_s) > 70


@pytest.mark.parametrize("n_late", [1, 10])
def test_poses_that_a_recorder_received_late_are_no_second_run(tmp_path, messages, n_late):
    rows = []
    for row, tick in enumerate([*range(60), *range(25, 25 + n_late), *range(60, 120)]):
        time_s = 100.0 + 0.1 * tick + (0.05 if 60 <= row < 60 + n_late else 0.0)
        rows.append(("/pose", time_s, messages.pose(time_s, 0.5, 0.1 * tick)))
    bag = BagReader(write_bag(tmp_path / "late", KINDS, rows))
    drive = mapped_drive_in(bag, BagMapping(pose_topic="/pose", action_from="hidden"))
    assert len(drive.pose_time_s) == 120 + n_late


def test_simulated_time_and_frames_are_put_right(foreign_bag):
    mapping = BagMapping(
        pose_topic="/robot/pose",
        frame="map",
        action_from="velocity",
        action_topic="cmd_vel",
    )
    drive = mapped_drive_in(foreign_bag, mapping)
    decisions, report = decisions_from_drive(drive, grid_around(drive.position_m, 1.0), 4.0, 1.0)
    assert drive.position_m[0].tolist() == [10.5, 0.5]
    np.testing.assert_allclose(decisions.time_s, [50.0, 51.2, 53.2], atol=1e-6)
    assert decisions.action.tolist() == [Action.NORTH] * 3
    assert decisions.censored.tolist() == [False, False, True]  # by the end of the last command
    assert report.dropped == {NO_COMMAND: 1}
    silent = mapping.model_copy(update={"silence": "wait"})
    waiting = mapped_drive_in(foreign_bag, silent)
    _, report = decisions_from_drive(waiting, grid_around(drive.position_m, 1.0), 4.0, 1.0)
    assert report.dropped == {}
    assert report.n_moving_waits >= 3


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("pose_topic: /robot/cmd_vel\naction_topic: pose", "/robot/cmd_vel must carry a pose, got"),
        (
            "pose_topic: pose\naction_topic: /tf",
            "/tf must carry a vector, got tf2_msgs/msg/TFMessage with the fields transforms; name",
        ),
        (
            "pose_topic: pose\npose_fields: [pose.position.x, pose.positon.y]",
            "pose_fields 'pose.positon.y' must be a path .* got 'positon'; did you mean 'position'",
        ),
        (
            "pose_topic: pose\npose_fields: [header.frame_id]",
            "must be paths of numbers, or one of a message, got 'header.frame_id'",
        ),
        (
            "pose_topic: pose\npose_fields: [pose.position]\naction_from: velocity\n"
            "action_topic: cmd_vel",
            "pose_topic pose must have a heading",
        ),
        (
            "pose_topic: /tf\naction_from: motion",
            "robot_frame must be a frame of /tf, got 'base_link'; ch",
        ),
        ("pose_topic: nose\naction_topic: cmd_vel", "must hold the topic 'nose', it holds /rob"),
        (
            "pose_topic: pose\naction_from: velocity\naction_topic: cmd_vel\nframe: world",
            "frame 'odom' must be joined with 'world' by /tf",
        ),
    ],
)
def test_a_mapping_that_does_not_fit_the_bag_gets_a_sentence(foreign_bag, text, sentence):
    with pytest.raises(BagError, match=sentence):
        mapped_drive_in(foreign_bag, yaml_model(text, BagMapping, name="x.yaml"))


ACKERMANN = "ackermann_msgs/msg/AckermannDriveStamped"


def test_the_motion_itself_is_the_action(foreign_bag):
    """It drives north at 0.5 m/s for 8 s; the topic of its commands is not needed."""
    mapping = BagMapping(pose_topic="/robot/pose", action_from="motion")
    drive = mapped_drive_in(foreign_bag, mapping)
    assert drive.intent_time_s.tolist() == [50.0]
    assert drive.intent_action.tolist() == [Action.NORTH]
    slow = mapping.model_copy(update={"minimum_speed_mps": 0.51})
    assert set(mapped_drive_in(foreign_bag, slow).intent_action) == {Action.WAIT}


def test_a_pose_from_tf_is_the_chain_from_the_frame_of_the_grid(tmp_path, messages):
    """odom moves in map by /tf at 10 Hz, base_link is ahead of it by /tf_static."""
    static = messages.transform(0.0, "odom", "base", 0.0, 2.0)
    rows = [("/tf_static", 50.0, static)]
    rows += [("/tf", 50.0 + n / 10, tf(messages, 50.0 + n / 10, n / 10)) for n in range(81)]
    bag = written(tmp_path / "tf", {"/tf": TF, "/tf_static": TF}, *rows)
    mapping = BagMapping(pose_topic="tf", action_from="motion", robot_frame="base")
    for frame in ("map", ""):
        known = mapping.model_copy(update={"frame": frame})
        drive = mapped_drive_in(bag, known)
        np.testing.assert_allclose(drive.position_m[:, 0], np.arange(81) / 10, atol=1e-9)
        np.testing.assert_allclose(drive.position_m[:, 1], 2.0)
        assert drive.intent_action.tolist() == [Action.EAST]
    still = mapping.model_copy(update={"frame": "odom"})
    with pytest.raises(BagError, match="frame 'base' must move in 'odom', /tf_static holds it"):
        mapped_drive_in(bag, still)


def test_a_steered_vehicle_and_own_types_are_read_by_their_fields(tmp_path, messages):
    """Speed of an AckermannDriveStamped; pose and speed in the lists of a Float64MultiArray."""
    store = typestore_of(message_type(ACKERMANN))
    state = "std_msgs/msg/Float64MultiArray"
    layout = messages.make("std_msgs/msg/MultiArrayLayout", [], 0)
    rows = []
    for time_s in np.arange(50.0, 58.01, 0.1):
        stamp = messages.header(time_s)
        drive = store.types["ackermann_msgs/msg/AckermannDrive"](0.1, 0.0, 1.0, 0.0, 0.0)
        data = bytes(store.serialize_cdr(store.types[ACKERMANN](stamp, drive), ACKERMANN))
        rows.append(("/drive", time_s, data))
        numbers = np.array([7.0, time_s - 50.0, 0.5, -math.pi / 2, 1.0])
        rows.append(
            ("/state", time_s, messages.encode(messages.make(state, layout, numbers), state))
        )
    bag = written(tmp_path / "car", {"/drive": ACKERMANN, "/state": state}, *rows)
    steered = BagMapping(
        pose_topic="/state", pose_fields=("data.1", "data.2", "data.3"),
        action_from="velocity", action_topic="/drive",
    )  # fmt: skip
    listed = steered.model_copy(update={"action_topic": "/state", "action_fields": ("data.4",)})
    for mapping in (steered, listed):
        drive = mapped_drive_in(bag, mapping)
        np.testing.assert_allclose(drive.position_m[[0, -1]], [[0.0, 0.5], [8.0, 0.5]], atol=1e-9)
        assert drive.intent_action.tolist() == [Action.SOUTH]


@pytest.mark.skipif(
    not REAL_BAG.is_dir(), reason="the real robot bag is not in ../shared/data/bags"
)
def test_the_real_robot_becomes_demonstrations():
    mapping = BagMapping(
        pose_topic="/odom",
        action_from="velocity",
        action_topic="/cmd_vel",
        silence="wait",
        stop_s=None,
        round_trips=False,
    )
    drive = mapped_drive_in(BagReader(REAL_BAG), mapping)
    grid = grid_around(drive.position_m, 0.5)
    decisions, report = decisions_from_drive(drive, grid, 4.0, 1.0)
    assert len(drive.pose_time_s) == 290
    assert len(drive.episodes) == 1
    assert report.n_decisions == len(decisions) >= 25
    np.testing.assert_allclose(decisions.dwell_s.sum(), np.ptp(drive.pose_time_s), atol=0.5)
    moved = decisions.select(decisions.state != decisions.next_state)
    assert len(moved) >= 4
    assert set(decisions.action) > {Action.WAIT}
    unknown = mapped_drive_in(
        BagReader(REAL_BAG), mapping.model_copy(update={"silence": "unknown"})
    )
    silent, silences = decisions_from_drive(unknown, grid, 4.0, 1.0)
    assert silent.dwell_s.sum() < 0.8 * decisions.dwell_s.sum()
    assert 5 < silences.dropped[NO_COMMAND] <= (unknown.intent_action == SILENCE).sum()


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"hold_s": 1.0, "action_from": "motion"}, "hold_s must be left out unless action_from is"),
        ({"waypoint_reached_m": 1.0}, "waypoint_reached_m must be left out unless action_from is"),
        ({"button_field": "buttons.0"}, "button_field must come with a button_topic"),
        ({"button_topic": "joy", "episode_topic": "episode"}, "button_topic must be left out with"),
        ({"goal_area_m": ((0, 0), (1, 1))}, "goal_area_m must have at least 3 corners, got 2"),
        (
            {"goals_m": ((0, 0),), "goal_area_m": ((0, 0), (1, 0), (1, 1))},
            "goals_m and goal_area_m must not both be given",
        ),
    ],
)
def test_keys_of_a_mapping_that_have_no_effect_are_rejected(keys, sentence):
    with pytest.raises(ValueError, match=sentence):
        BagMapping(**keys)


@pytest.fixture
def own_bag(tmp_path, messages):
    """Two episodes in a namespace: one arrives, one is cut off; waypoints beside the intents."""
    rows = []
    for episode, start_s in enumerate((10.0, 30.0)):
        rows.append(("/robot/episode", start_s, messages.mark(start_s, "start", episode)))
        for tick in range(100):
            time_s, y_m = start_s + 0.1 * tick, 0.1 * tick
            rows.append(("/robot/robot_pose", time_s, messages.pose(time_s, 0.0, y_m)))
            if tick % 20 == 0:
                rows.append(("/robot/intent", time_s, messages.intent(time_s, 0.0, 1.0)))
                goal = messages.pose(time_s, 0.0, y_m + 1.0)
                rows.append(("/robot/waypoint", time_s, goal))
        if episode == 0:
            rows.append(("/robot/episode", 19.9, messages.mark(19.9, "end", episode, "arrived")))
    topics = {f"/robot{name}": kind for name, kind in OWN_TOPICS.items()}
    return write_bag(tmp_path / "own", topics | {"/robot/waypoint": POSE}, rows)


def test_a_mapping_of_our_own_topics_changes_nothing(own_bag):
    direct = read_drives(own_bag)[0]
    mapped = mapped_drive_in(BagReader(own_bag), BagMapping(episode_topic="episode"))
    assert [span.outcome for span in direct.episodes] == ["arrived", "cut_off"]
    assert mapped.episodes == direct.episodes
    for name in ("pose_time_s", "position_m", "intent_time_s", "intent_action"):
        assert np.array_equal(getattr(mapped, name), getattr(direct, name))


def test_waypoints_ahead_mean_what_the_intents_say(own_bag):
    mapping = BagMapping(
        action_from="waypoint", action_topic="waypoint", episode_topic="/robot/episode"
    )
    drive = mapped_drive_in(BagReader(own_bag), mapping)
    assert set(drive.intent_action) == {Action.NORTH}
    assert np.array_equal(drive.intent_time_s, read_drives(own_bag)[0].intent_time_s)


def test_decoded_messages_come_by_their_short_names(own_bag):
    found = [(name, message.header.stamp.sec) for name, message in messages_of(own_bag, ["intent"])]
    assert found[:2] == [("intent", 10), ("intent", 12)]
    with pytest.raises(BagError, match="must hold scan, it holds episode, intent, robot_pose"):
        list(messages_of(own_bag, ["scan"]))
