"""A suggested mapping gives decisions at the first attempt, and they explain the motion."""

import math
from unittest.mock import patch

import numpy as np
import pytest

from serd_app.demonstrations.discretise import MOST_MOVING_WAITS, demonstrations_of_drives
from serd_app.demonstrations.fitted_grid import fitted_grid
from serd_app.demonstrations.suggest import suggest_mapping
from serd_app.drives.mapping import ASSUMED_UNITS, BagMapping
from serd_app.drives.recording import read_recording
from serd_app.errors import AppError
from serd_bag.reader import BagReader
from serd_files.yaml_config import yaml_model
from support.foreign_bags import START_S, ForeignBag, Robot, held_keys, key_presses

DEFAULT_ROBOT = Robot()


@pytest.fixture
def bag(messages):
    return ForeignBag(messages)


def driven(seed, make=key_presses, robot=DEFAULT_ROBOT):
    """Commands of keys and the track of a robot that obeys them."""
    commands = make(np.random.default_rng(seed))
    return commands, robot.drive(commands, commands[-1][0] + 5.0)


def suggested(bag, tmp_path):
    """The suggestion: read in one pass, it gives what `serd demos` takes from the bag."""
    path = bag.write(tmp_path / "bag")
    with patch.object(BagReader, "messages", autospec=True, side_effect=BagReader.messages) as read:
        found = suggest_mapping(path)
    assert read.call_count == 1
    report = found.report
    assert report.n_decisions >= 5
    assert report.n_moving_waits <= MOST_MOVING_WAITS * report.n_decisions
    text = found.yaml(tmp_path / "mapping.yaml")
    assert yaml_model(text, BagMapping, name="mapping.yaml") == found.mapping
    recording = read_recording(path, mapping=found.mapping, tolerant=True)
    assert recording.assumed == (ASSUMED_UNITS,)
    assert f"# {ASSUMED_UNITS}\n" in text
    grid = fitted_grid([recording], found.cell_size_m)
    assert demonstrations_of_drives(recording.drives, grid, 4.0, 1.0)[1] == report
    return found


@pytest.mark.parametrize("seed", range(2))
def test_whether_a_robot_keeps_the_last_command_or_stops_by_a_timeout_is_found(
    messages, tmp_path, seed
):
    for make, robot in ((key_presses, Robot(delay_s=0.2)), (held_keys, Robot(hold_s=0.5))):
        bag, (commands, track) = ForeignBag(messages), driven(seed, make, robot)
        bag.add_odometry("/odom", track)
        bag.add_commands("/cmd_vel", commands)
        mapping = suggested(bag, tmp_path / make.__name__).mapping
        assert (mapping.pose_topic, mapping.action_topic) == ("/odom", "/cmd_vel")
        assert mapping.action_from == "velocity"
        if make is key_presses:
            assert mapping.hold_s is None
            assert 0.1 <= mapping.delay_s <= 0.5
        else:
            assert mapping.silence == "wait"
            assert 0.25 <= mapping.hold_s <= 1.0


def test_topics_of_one_namespace_with_stamped_commands_are_found_by_a_clock_an_hour_ahead(
    bag, tmp_path
):
    for seed, robot, offset_m in ((1, "alpha", 0.0), (2, "beta", 5.0)):
        commands, track = driven(seed)
        bag.add_odometry(f"/{robot}/odom", track, offset_m=offset_m, ahead_s=3600.0)
        bag.add_commands(f"/{robot}/cmd_vel", commands, stamped=True)
    mapping = suggested(bag, tmp_path).mapping
    assert mapping.pose_topic.split("/")[1] == mapping.action_topic.split("/")[1]
    assert mapping.action_from == "velocity"


def test_of_several_poses_one_that_moves_with_the_commands_is_taken(bag, tmp_path):
    commands, track = driven(2)
    still = track.copy()
    still[:, 1:] = 0.0
    bag.add_odometry("/camera/odom/sample", still)
    bag.add_odometry("/wheel/odometry", track)
    bag.add_odometry("/odometry/filtered", track)
    bag.add_odometry("/amcl_pose", track, every=100)
    for time_s in (3.0, 20.0):
        bag.add_pose("/goal_pose", time_s, 9.0, 9.0)
    bag.add_commands("/cmd_vel", commands)
    bag.add_commands("/cmd_vel_nav", [(time_s, -speed, 0.0) for time_s, speed, _ in commands])
    found = suggested(bag, tmp_path)
    assert found.mapping.pose_topic in ("/wheel/odometry", "/odometry/filtered")
    assert found.mapping.action_topic == "/cmd_vel"
    text = found.yaml(tmp_path / "mapping.yaml")
    (other,) = {"/wheel/odometry", "/odometry/filtered"} - {found.mapping.pose_topic}
    assert "# pose on /odometry/filtered: " in text
    assert f"# or {other} with /cmd_vel: they" in text


@pytest.mark.parametrize(
    ("n_commands", "comment"), [(0, "no velocity commands were found"), (140, "disagree in")]
)
def test_actions_are_hidden_where_no_commands_explain_the_motion(
    bag, tmp_path, n_commands, comment
):
    """The name of the topic is one that a terminal obeys: the mapping is YAML all the same."""
    topic, rng = "/\x1b[31m\u202eodom", np.random.default_rng(5)
    bag.add_odometry(topic, driven(4)[1])
    bag.add_commands("/cmd_vel", [(0.5 * n, rng.normal(), 0.0) for n in range(n_commands)])
    found = suggested(bag, tmp_path)
    assert (found.mapping.pose_topic, found.mapping.action_from) == (topic, "hidden")
    assert comment in found.comments["action_from"][0]
    assert "\x1b" not in found.yaml(tmp_path / "mapping.yaml")


@pytest.mark.parametrize(("moved_m", "frame"), [(2.0, "site"), (0.0, "")])
def test_odometry_is_taken_in_the_frame_of_a_map_that_corrects_it(bag, tmp_path, moved_m, frame):
    """The map moves by 2 m in odom, by which the last lap would lie beside the first."""
    commands, track = driven(7)
    drift = np.c_[track[:, 0], np.linspace(0.0, moved_m, len(track)), np.zeros((len(track), 3))]
    bag.add_odometry("/odom", track)
    bag.add_tf("/tf", track, "odom", "chassis")
    bag.add_tf("/tf", drift, "site", "odom")
    bag.add_commands("/cmd_vel", commands)
    found = suggested(bag, tmp_path)
    assert (found.mapping.pose_topic, found.mapping.frame) == ("/odom", frame)
    corrected = "as a localisation corrects odometry" in found.comments.get("frame", [""])[0]
    assert corrected == bool(frame)


def test_of_frames_of_tf_the_robot_is_known_by_its_name(bag, tmp_path):
    frame = "husky/base_link"
    commands, track = driven(8)
    wheel = np.c_[track[:, 0], np.zeros((len(track), 2)), 9.0 * track[:, 0], track[:, 4]]
    bag.add_tf("/tf", track, "site", frame)
    bag.add_tf("/tf", wheel, frame, "left_wheel")
    bag.add_commands("/husky/cmd_vel", commands)
    mapping = suggested(bag, tmp_path).mapping
    assert (mapping.pose_topic, mapping.robot_frame) == ("/tf", frame)
    assert mapping.action_from == "velocity"


@pytest.mark.parametrize(
    ("x_m", "sentence"),
    [(0.0, "/odom does not move, it stays within 0.00 m"), (math.nan, "must hold poses")],
)
def test_a_recording_without_a_robot_that_moves_is_refused_with_its_topics(
    bag, tmp_path, x_m, sentence
):
    track = Robot().drive([(0.0, 0.0, 0.0)], 20.0)
    track[:, 1] = x_m
    bag.add_odometry("/odom", track)
    bag.add_commands("/cmd_vel", [(1.0, 0.0, 0.0)])
    with pytest.raises(AppError, match=r"it holds /cmd_vel .geometry_msgs/msg/Twist.*") as caught:
        suggest_mapping(bag.write(tmp_path / "bag"))
    assert sentence in str(caught.value)
    (tmp_path / "tracks.csv").write_text("t,x,y\n0,0,0\n1,1,0\n")
    with pytest.raises(AppError, match="a table of trajectories needs no mapping, run 'serd demos"):
        suggest_mapping(tmp_path / "tracks.csv")


def test_a_recording_of_ours_needs_no_mapping(bag, messages, tmp_path):
    bag.add_pose("/robot_pose", 0.0, 0.0, 0.0)
    data = messages.intent(START_S, 1.0, 0.0)
    bag.add("/intent", "geometry_msgs/msg/Vector3Stamped", 0.1, data)
    bag.add("/episode", "diagnostic_msgs/msg/DiagnosticArray", 0.1, messages.mark(0.1, "start", 0))
    with pytest.raises(AppError, match=r"needs no mapping; run 'serd demos .* --scenario NAME'"):
        suggest_mapping(bag.write(tmp_path / "bag"))
