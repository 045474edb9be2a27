"""Bags of other robots by a mapping file: frames, clocks, inferred actions, a fitted grid."""

import math

import numpy as np
import pytest

from serd_app.demonstrations.discretise import NO_COMMAND, decisions_from_drive
from serd_app.demonstrations.fitted_grid import grid_around
from serd_app.drives.actions import (
    PoseTrack,
    actions_of_ways,
    hidden_intents,
    intents_of_velocities,
    posed_intents,
)
from serd_app.drives.drive import NOT_FINITE, SILENCE, EpisodeSpan
from serd_app.drives.mapped import mapped_drive_in
from serd_app.drives.mapping import BagMapping
from serd_app.drives.sessions import read_drives
from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import message_type, typestore_of
from serd_bag.reader import BagReader
from serd_core.grid.grid import Action
from serd_files.yaml_config import yaml_model
from support.bag_messages import OWN_TOPICS, POSE, TF, TWIST, VECTOR, write_bag

EAST, NORTH, WEST, SOUTH, WAIT = (
    Action[name] for name in ("EAST", "NORTH", "WEST", "SOUTH", "WAIT")
)


SPAN = EpisodeSpan(0, 0.0, 4.0, "arrived")
STEADY = [(0.1 * tick, 0.5, 0.0) for tick in range(41)]
BACKWARDS = [(time_s, -speed, left) for time_s, speed, left in STEADY]
ONE = [(0.0, 0.5, 0.0)]


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
    assert found["intent_hold_s"] == math.inf
    at_s, action = found["intent_time_s"].round(6), found["intent_action"]
    return list(zip(at_s.tolist(), action.tolist(), strict=True))


@pytest.mark.parametrize(
    ("commands", "options", "expected"),
    [
        (STEADY, {}, [(0.0, EAST)]),
        (STEADY, {"yaw_rad": math.pi / 2}, [(0.0, NORTH)]),
        (STEADY, {"yaw_rad": math.pi}, [(0.0, WEST)]),
        (BACKWARDS, {}, [(0.0, WEST)]),
        (ONE, {}, [(0.0, EAST), (0.5, SILENCE)]),
        (ONE, {"hold_s": math.inf}, [(0.0, EAST)]),
        ([], {}, [(0.0, SILENCE)]),
        ([(2.0, 0.0, 0.0)], {}, [(0.0, SILENCE), (2.0, WAIT), (2.5, SILENCE)]),
        ([(3.4, 0.5, 0.0)], {}, [(0.0, SILENCE), (3.4, EAST), (3.9, SILENCE)]),
        ([(-0.5, 0.5, 0.0), (4.0, 0.5, 0.0)], {}, [(0.0, SILENCE)]),
    ],
)
def test_velocity_commands_mean_the_direction_they_drive_to_while_they_hold(
    commands, options, expected
):
    assert velocity_actions(commands, **options) == expected


def test_a_robot_that_waits_in_silence_waits_before_and_after_a_command():
    waiting = velocity_actions([(1.0, 0.5, 0.0)], waits_in_silence=True)
    assert [action for _, action in waiting] == [WAIT, EAST, WAIT]


def test_a_command_that_is_held_through_a_turn_means_the_heading_of_the_next_second():
    """It turns by a quarter in 2 s: through north-east at 1 s, which is the middle of a second that
    begins at 0.5 s."""
    time_s = np.arange(0.0, 8.01, 0.1)
    found = velocity_actions(
        ONE,
        yaw_rad=np.pi / 4.0 * time_s,
        hold_s=10.0,
        span=EpisodeSpan(0, 0.0, 8.0, "arrived"),
        pose_time_s=time_s,
    )
    at_s, actions = zip(*found, strict=True)
    assert actions == (EAST, NORTH, WEST, SOUTH, EAST)
    np.testing.assert_allclose(at_s, [0.0, 0.5, 2.5, 4.5, 6.5], atol=0.11)


def test_each_episode_has_an_intent_at_its_start():
    spans = SPAN, EpisodeSpan(1, 4.0, 6.0, "arrived")
    assert hidden_intents(spans)["intent_time_s"].tolist() == [0.0, 4.0]
    track = PoseTrack(*[np.array([0.0, 6.0])] * 2, np.array([[0.0, 0.0, 0.0], [6.0, 0.0, 0.0]]))
    moving = posed_intents(BagMapping(action_from="motion"), track, spans)
    assert moving["intent_time_s"].tolist() == [0.0, 4.0]
    assert moving["intent_action"].tolist() == [EAST] * 2
    assert len(posed_intents(BagMapping(action_from="motion"), track, ())["intent_time_s"]) == 0


def test_ways_mean_their_direction_and_short_ones_a_wait():
    ways_m = np.array([[1.0, 0.2], [0.1, -0.8], [0.1, 0.1], [0.0, 0.0]])
    assert actions_of_ways(ways_m, np.full(4, 0.25)).tolist() == [EAST, SOUTH, WAIT, WAIT]
    assert actions_of_ways(ways_m[2:], np.zeros(2)).tolist() == [EAST, WAIT]


KINDS = {"/pose": POSE, "/cmd_vel": TWIST, "/tf": TF}
DRIVEN = BagMapping(pose_topic="/pose", action_from="velocity", action_topic="/cmd_vel")
HIDDEN = BagMapping(pose_topic="/pose", action_from="hidden")


@pytest.fixture
def drive_of(tmp_path):
    """The drive by a mapping of rows (topic, time, bytes), which are put in the order of time."""

    def make(rows, mapping=DRIVEN, topics=None):
        folder = tmp_path / f"bag {len(list(tmp_path.iterdir()))}"
        topics = KINDS | (topics or {})
        written = write_bag(folder, topics, sorted(rows, key=lambda row: row[1]))
        return mapped_drive_in(BagReader(written), mapping)

    return make


def with_keys(mapping, **keys):
    return mapping.model_copy(update=keys)


def drive_east(messages, frame="map", step_s=0.1):
    """Rows of poses of a robot that drives along x from 0 at 1 m/s for 8 s, and its commands."""
    rows = []
    for time_s in np.arange(0.0, 8.0 + 1e-9, step_s) + 50.0:
        rows.append(("/pose", time_s, messages.pose(time_s, time_s - 50.0, 0.5, frame=frame)))
        rows.append(("/cmd_vel", time_s, messages.twist(0.5)))
    return rows


def poses_east(messages):
    return [row for row in drive_east(messages) if row[0] == "/pose"]


def odom_at(messages, times_s, x=10.0):
    """odom at x in the map at those times."""
    return [("/tf", at_s, messages.transform(at_s, "map", "odom", x, 0.0)) for at_s in times_s]


def test_poses_that_no_transform_reaches_are_left_out_and_counted(drive_of, messages):
    rows, in_map = drive_east(messages, "odom"), with_keys(DRIVEN, frame="map")
    drive = drive_of([*rows, *odom_at(messages, np.arange(53.0, 56.01, 0.5))], in_map)
    assert drive.n_unplaced_poses == 20 + 10
    assert (drive.pose_time_s[0], drive.pose_time_s[-1]) == pytest.approx((52.0, 57.0))
    np.testing.assert_allclose(drive.position_m[[0, -1]], [[12.0, 0.5], [17.0, 0.5]])
    _, report = decisions_from_drive(drive, grid_around(drive.position_m, 0.5), 4.0, 1.0)
    assert report.n_unplaced_poses == 30
    with pytest.raises(BagError, match=r"/tf must join 'odom' with 'map' .* at least once; record"):
        drive_of([*rows, *odom_at(messages, np.arange(0.0, 3.0, 0.5))], in_map)


def test_a_topic_of_actions_without_a_message_is_refused(drive_of, messages):
    with pytest.raises(BagError, match="action_topic /cmd_vel must hold messages, it holds none"):
        drive_of(poses_east(messages))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_command_that_is_not_finite_is_left_out_and_counted(drive_of, messages, bad):
    rows = drive_east(messages)
    sound, drive = drive_of(rows), drive_of([*rows, ("/cmd_vel", 53.05, messages.twist(bad))])
    assert (sound.n_bad_commands, drive.n_bad_commands) == (0, 1)
    assert drive.intent_action.tolist() == sound.intent_action.tolist()
    _, report = decisions_from_drive(drive, grid_around(drive.position_m, 1.0), 4.0, 1.0)
    assert str(report).endswith("; 1 commands not finite")


def test_an_intent_sent_again_is_one_and_one_not_finite_is_dropped_and_counted(drive_of, messages):
    wishes = [(50.0, 99.0), (50.0, 99.0), (52.0, np.nan), (54.0, 99.0), (54.0, 99.0)]
    rows = [("/wish", time_s, messages.intent(time_s, east, 0.5)) for time_s, east in wishes]
    mapping = BagMapping(pose_topic="/pose", action_topic="/wish")
    drive = drive_of([*poses_east(messages), *rows], mapping, {"/wish": VECTOR})
    assert drive.dropped == {NOT_FINITE: 1}
    assert drive.intent_time_s.tolist() == [50.0, 54.0]
    assert drive.intent_action.tolist() == [EAST, EAST]


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
        moved = messages.transform(time_s, "map", "odom", 0.1 * tick, 0.0)
        rows.append((topic, log_s, pose if topic == "/pose" else moved))
    bag = BagReader(write_bag(tmp_path / "two", KINDS, rows))
    frames = {"frame": "map", "robot_frame": "odom"} if topic == "/tf" else {}
    mapping = with_keys(HIDDEN, pose_topic=topic, **frames)
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
    assert len(mapped_drive_in(bag, HIDDEN).pose_time_s) == 120 + n_late


@pytest.fixture
def foreign_bag(tmp_path, messages):
    """A robot that looks north and drives so, in a frame 10 m off the map, at ten times real time:
    stamps are simulated time, log times wall time, velocity commands have no stamp."""
    rows = []
    for tick in range(81):
        time_s, log_s = 50.0 + 0.1 * tick, 1e9 + 0.01 * tick
        pose = messages.pose(time_s, 0.5, 0.5 + 0.05 * tick, frame="odom")
        moved = messages.transform(time_s, "map", "odom", 10.0, 0.0)
        rows += [("/tf", log_s, moved), ("/robot/pose", log_s, pose)]
        if tick < 40:
            rows.append(("/robot/cmd_vel", log_s, messages.twist(0.5)))
    kinds = {"/robot/pose": POSE, "/robot/cmd_vel": TWIST, "/tf": TF}
    return BagReader(write_bag(tmp_path / "foreign", kinds, rows))


def test_simulated_time_and_frames_are_put_right(foreign_bag):
    mapping = with_keys(DRIVEN, pose_topic="/robot/pose", frame="map", action_topic="cmd_vel")
    drive = mapped_drive_in(foreign_bag, mapping)
    decisions, report = decisions_from_drive(drive, grid_around(drive.position_m, 1.0), 4.0, 1.0)
    assert drive.position_m[0].tolist() == [10.5, 0.5]
    np.testing.assert_allclose(decisions.time_s, [50.0, 51.2, 53.2], atol=1e-6)
    assert decisions.action.tolist() == [NORTH] * 3
    assert decisions.censored.tolist() == [False, False, True]  # by the end of the last command
    assert report.dropped == {NO_COMMAND: 1}
    waiting = mapped_drive_in(foreign_bag, with_keys(mapping, silence="wait"))
    _, report = decisions_from_drive(waiting, grid_around(drive.position_m, 1.0), 4.0, 1.0)
    assert report.dropped == {}
    assert report.n_moving_waits >= 3


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("pose_topic: /robot/cmd_vel, action_topic: pose", "/robot/cmd_vel must carry a pose, got"),
        ("pose_topic: pose, action_topic: /tf",
         "/tf must carry a vector, got tf2_msgs/msg/TFMessage with the fields transforms; name"),
        ("pose_topic: pose, pose_fields: [pose.position.x, pose.positon.y]",
         "pose_fields 'pose.positon.y' must be a path .* got 'positon'; did you mean 'position'"),
        ("pose_topic: pose, pose_fields: [header.frame_id]",
         "must be paths of numbers, or one of a message, got 'header.frame_id'"),
        ("pose_topic: pose, pose_fields: [pose.position], action_from: velocity,"
         " action_topic: cmd_vel", "pose_topic pose must have a heading"),
        ("pose_topic: /tf, action_from: motion",
         "robot_frame must be a frame of /tf, got 'base_link'; ch"),
        ("pose_topic: nose, action_topic: cmd_vel", "must hold the topic 'nose', it holds /rob"),
        ("pose_topic: pose, action_from: velocity, action_topic: cmd_vel, frame: world",
         "frame 'odom' must be joined with 'world' by /tf"),
    ],
)  # fmt: skip
def test_a_mapping_that_does_not_fit_the_bag_gets_a_sentence(foreign_bag, text, sentence):
    with pytest.raises(BagError, match=sentence):
        mapped_drive_in(foreign_bag, yaml_model(f"{{{text}}}", BagMapping, name="x.yaml"))


def test_a_pose_from_tf_is_the_chain_from_the_frame_of_the_grid(drive_of, messages):
    """odom moves in map by /tf at 10 Hz, base_link is ahead of it by /tf_static."""
    rows = [("/tf_static", 50.0, messages.transform(0.0, "odom", "base", 0.0, 2.0))]
    for tick in range(81):
        rows += odom_at(messages, [50.0 + tick / 10], tick / 10)
    mapping = BagMapping(pose_topic="tf", action_from="motion", robot_frame="base")
    for frame in ("map", ""):
        drive = drive_of(rows, with_keys(mapping, frame=frame), {"/tf_static": TF})
        np.testing.assert_allclose(drive.position_m[:, 0], np.arange(81) / 10, atol=1e-9)
        np.testing.assert_allclose(drive.position_m[:, 1], 2.0)
        assert drive.intent_action.tolist() == [EAST]
    with pytest.raises(BagError, match="frame 'base' must move in 'odom', /tf_static holds it"):
        drive_of(rows, with_keys(mapping, frame="odom"), {"/tf_static": TF})


def test_a_steered_vehicle_and_own_types_are_read_by_their_fields(drive_of, messages):
    """Speed of an AckermannDriveStamped; pose and speed in the lists of a Float64MultiArray."""
    ackermann, state = "ackermann_msgs/msg/AckermannDriveStamped", "std_msgs/msg/Float64MultiArray"
    store = typestore_of(message_type(ackermann))
    layout = messages.make("std_msgs/msg/MultiArrayLayout", [], 0)
    rows = []
    for time_s in np.arange(50.0, 58.01, 0.1):
        speed = store.types["ackermann_msgs/msg/AckermannDrive"](0.1, 0.0, 1.0, 0.0, 0.0)
        steered = store.types[ackermann](messages.header(time_s), speed)
        rows.append(("/drive", time_s, bytes(store.serialize_cdr(steered, ackermann))))
        numbers = np.array([7.0, time_s - 50.0, 0.5, -math.pi / 2, 1.0])
        listed = messages.encode(messages.make(state, layout, numbers), state)
        rows.append(("/state", time_s, listed))
    mapping = BagMapping(
        pose_topic="/state", pose_fields=("data.1", "data.2", "data.3"),
        action_from="velocity", action_topic="/drive",
    )  # fmt: skip
    for keys in ({}, {"action_topic": "/state", "action_fields": ("data.4",)}):
        topics = {"/drive": ackermann, "/state": state}
        drive = drive_of(rows, with_keys(mapping, **keys), topics)
        np.testing.assert_allclose(drive.position_m[[0, -1]], [[0.0, 0.5], [8.0, 0.5]], atol=1e-9)
        assert drive.intent_action.tolist() == [SOUTH]


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"hold_s": 1.0, "action_from": "motion"}, "hold_s must be left out unless action_from is"),
        ({"goal_area_m": ((0, 0), (1, 1))}, "must have at least 3 corners, got 2"),
    ],
)  # fmt: skip
def test_keys_of_a_mapping_that_have_no_effect_are_rejected(keys, sentence):
    with pytest.raises(ValueError, match=sentence):
        BagMapping(**keys)


@pytest.fixture
def own_bag(tmp_path, messages):
    """Two episodes in a namespace: one arrives, one is cut off."""
    rows = []
    for episode, start_s in enumerate((10.0, 30.0)):
        rows.append(("/robot/episode", start_s, messages.mark(start_s, "start", episode)))
        for tick in range(100):
            time_s, y_m = start_s + 0.1 * tick, 0.1 * tick
            rows.append(("/robot/robot_pose", time_s, messages.pose(time_s, 0.0, y_m)))
            if tick % 20 == 0:
                rows.append(("/robot/intent", time_s, messages.intent(time_s, 0.0, 1.0)))
    rows.append(("/robot/episode", 19.9, messages.mark(19.9, "end", 0, "arrived")))
    rows.sort(key=lambda row: row[1])
    topics = {f"/robot{name}": kind for name, kind in OWN_TOPICS.items()}
    return write_bag(tmp_path / "own", topics, rows)


def test_a_mapping_of_our_own_topics_gives_the_drive_of_the_recorder(own_bag):
    (direct,) = read_drives(own_bag)
    assert [span.outcome for span in direct.episodes] == ["arrived", "cut_off"]
    assert set(direct.intent_action) == {NORTH}
    assert (direct.n_bad_poses, direct.n_unplaced_poses, direct.n_bad_commands) == (0, 0, 0)
    mapped = mapped_drive_in(BagReader(own_bag), BagMapping(episode_topic="/robot/episode"))
    assert mapped.episodes == direct.episodes
    for name in ("pose_time_s", "position_m", "intent_time_s", "intent_action"):
        assert np.array_equal(getattr(mapped, name), getattr(direct, name))
