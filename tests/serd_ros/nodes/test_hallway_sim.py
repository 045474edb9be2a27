"""Whom a world with several robots waits for: before an episode, before each step; their URDF."""

import math
from contextlib import contextmanager
from xml.etree import ElementTree

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, Vector3
from rclpy.serialization import deserialize_message
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from bags.formats.rosbag2.message_types import rosbags_types
from bags.messages.plain import transforms
from serd_app.drives.episode_mark import START, EpisodeMark
from serd_ros.convert.command import to_twist_stamped
from serd_ros.convert.diagnostics import to_episode_message
from serd_ros.convert.frames import Frames
from serd_ros.convert.stamp import stamp_s
from serd_ros.endpoints import qos
from serd_ros.endpoints.topic_types import TopicType
from serd_ros.endpoints.transforms import TF_TYPE
from serd_ros.errors import NodeError
from serd_ros.graph.readiness import PATIENCE_S
from serd_ros.process.serd_node import BAD_INPUT
from sim.episodes.result import EpisodeStart
from sim.robot.urdf import BUILTIN_URDF
from sim.world.command import Command
from storage.yaml_config import model_yaml
from support.nodes_in_process import NodeInProcess, node_in_process
from support.waiting import wait_until
from support.wheeled_robots import physical, urdf_with

ROBOTS = ("robot1", "robot2")


@contextmanager
def world(**parameters):
    """The node of the world and those of its robots."""
    with node_in_process(
        "hallway_sim", robots=list(ROBOTS), lockstep=True, people=0, **parameters
    ) as running:
        yield running, [NodeInProcess(each) for each in running.node.companions]


@contextmanager
def driver_of(robot):
    """A node that publishes episodes of a robot."""
    driver = rclpy.create_node("scripted_expert", namespace=robot.node.get_namespace())
    driver.create_publisher(DiagnosticArray, "episode", 1)
    known = driver.get_name(), driver.get_namespace()
    wait_until(lambda: known in robot.node.get_node_names_and_namespaces())
    wait_until(lambda: robot.node.count_publishers("episode"))
    yield
    driver.destroy_node()


@contextmanager
def viewer():
    """A node that joins late; returns the messages of a latched topic when its first has come."""
    node = rclpy.create_node("viewer")

    def received(kind, topic):
        taken = []
        node.create_subscription(kind, topic, taken.append, qos.LATCHED, raw=True)
        wait_until(lambda: taken, turn=lambda: rclpy.spin_once(node, timeout_sec=0.1))
        return taken

    yield received
    node.destroy_node()


def description_and_frames(received, prefix=""):
    """Text of `robot_description`, and the frames of /tf_static, as one who joins late has them."""
    (text,) = received(String, f"{prefix}robot_description")
    (data,) = received(TopicType(TF_TYPE).message, f"{prefix}tf_static")
    frames = Frames()
    for each in transforms(data, TF_TYPE, rosbags_types()):
        frames.take(each, static=True)
    return deserialize_message(text, String).data, frames


def links_of(text):
    return {each.get("name") for each in ElementTree.fromstring(text).findall("link")}


def test_the_urdf_and_a_path_from_each_of_its_links_to_the_base_are_latched():
    with node_in_process("hallway_sim", people=0), viewer() as received:
        text, frames = description_and_frames(received)
    assert text == BUILTIN_URDF.read_text(encoding="utf-8")
    placed = {link: frames.place(link, "base_link") for link in links_of(text)}
    assert len(placed) == 5
    assert {each.stamp_ns for each in placed.values()} == {None}
    assert placed["right_wheel"].matrix[:3, 3] == pytest.approx([0.0, -0.16, 0.08])


@pytest.mark.parametrize("drive", ["kinematic", "physical"])
def test_the_urdf_is_that_which_the_scenario_names_with_either_drive(drive, tmp_path):
    urdf = urdf_with(tmp_path, ('xyz="0.2 0 0.031"', 'xyz="0.2 0 0.031" rpy="0 0.5 0"'))
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text(model_yaml(physical(drive=drive, urdf=str(urdf))))
    with node_in_process("hallway_sim", scenario=str(scenario)), viewer() as received:
        text, frames = description_and_frames(received)
    assert text == urdf.read_text(encoding="utf-8")
    turned = frames.place("front_caster", "base_link", level=False).matrix
    assert turned[:3, :3] @ [0.0, 0.0, 1.0] == pytest.approx([math.sin(0.5), 0.0, math.cos(0.5)])


def test_frames_of_links_have_the_prefix_of_their_robot_and_the_text_has_none():
    with world(), viewer() as received:
        for robot in ROBOTS:
            text, frames = description_and_frames(received, f"{robot}/")
            assert {f"{robot}/{link}" for link in links_of(text)} == set(frames.names)


def ask(robot):
    response = robot.call("reset", Trigger.Request())
    return response.success, response.message


def test_an_episode_waits_for_the_driver_of_a_robot_that_has_not_been_started_yet():
    with world(required_nodes=["scripted_expert"]) as (_, (first, second)), driver_of(first):
        assert not ask(first)[0]
        first.wait(PATIENCE_S)
        assert ask(first) == (False, "the driver of /robot2")
        with driver_of(second):
            assert not ask(second)[0]
            second.wait(PATIENCE_S)
            for robot in (second, first):
                success, message = ask(robot)
                assert success
                assert '"episode":0' in message


def test_a_robot_without_an_answer_is_named_though_another_one_repeats_its_own(capsys):
    with (
        world(lockstep_timeout_s=10.0) as (running, (first, second)),
        driver_of(first),
        driver_of(second),
    ):
        assert ask(first) == (False, "the driver of /robot2")
        assert ask(second)[0]
        command = to_twist_stamped(Command(0.2, 0.0), stamp_s(running.sent["clock"].clock))
        for _ in range(11):
            first.receive("robot1/cmd_vel", command)
            running.wait(1.0)
            running.call_timers()
        assert running.node.finished.done()
        assert "arrived on /robot2/cmd_vel within lockstep_timeout_s = 10 s" in (
            capsys.readouterr().err
        )


def mark_of(message):
    """What a driver publishes when it begins the episode of a response."""
    start = EpisodeStart.model_validate_json(message)
    return to_episode_message(EpisodeMark(START, start.start_s, start.episode))


def test_a_request_of_a_driver_that_received_no_response_gets_the_same_episode():
    with (
        world(lockstep_timeout_s=10.0) as (running, (first, second)),
        driver_of(first),
        driver_of(second),
    ):
        assert ask(first) == (False, "the driver of /robot2")
        begun = ask(second)
        assert ask(first) == ask(first) == ask(second) == begun
        assert begun[0]
        for robot in (first, second):
            name = robot.node.get_namespace().strip("/")
            robot.receive(f"{name}/episode", mark_of(begun[1]))
        assert time_after_commands(running, (first, second)) == 0.05
        assert ask(first) == (False, "the driver of /robot2")
        success, message = ask(second)
        assert success
        assert EpisodeStart.model_validate_json(message).episode == 1


def episodes_of_two_requests(running, between=lambda: None):
    """The episodes of the responses; between: done before the second request."""
    found = []
    for do in (lambda: None, between):
        do()
        success, message = ask(running)
        assert success
        found.append(EpisodeStart.model_validate_json(message).episode)
    return found


def test_each_request_by_hand_begins_an_episode_where_no_node_marks_them():
    with node_in_process("hallway_sim", people=0) as running:
        assert episodes_of_two_requests(running) == [0, 1]


def test_a_request_by_hand_begins_an_episode_once_the_robot_has_moved():
    with node_in_process("hallway_sim", people=0) as running, driver_of(running):

        def drive():
            running.receive("cmd_vel", Twist(linear=Vector3(x=0.5)))
            for _ in range(5):
                running.call_timers()

        assert episodes_of_two_requests(running) == [0, 0]
        assert episodes_of_two_requests(running, drive) == [0, 1]


def test_a_heading_on_the_other_side_of_180_degrees_is_no_motion():
    with node_in_process("hallway_sim", people=0) as running, driver_of(running):

        def turn():
            (robot,) = running.node._robots
            x_m, y_m, yaw_rad = robot._start_pose
            robot._start_pose = x_m, y_m, yaw_rad + math.tau

        assert episodes_of_two_requests(running, turn) == [0, 0]


@contextmanager
def driven_world():
    """A world whose robots have begun an episode; their drivers end before it does."""
    with world(lockstep_timeout_s=10.0) as (running, robots):
        with driver_of(robots[0]), driver_of(robots[1]):
            assert ask(robots[0]) == (False, "the driver of /robot2")
            assert ask(robots[1])[0]
        wait_until(lambda: not any(each.node.count_publishers("episode") for each in robots))
        yield running, robots


def time_after_commands(running, robots):
    """The time of the world after a command of each of these robots for its present tick."""
    command = to_twist_stamped(Command(0.2, 0.0), stamp_s(running.sent["clock"].clock))
    for robot in robots:
        robot.receive(f"{robot.node.get_namespace()}/cmd_vel".strip("/"), command)
    return stamp_s(running.sent["clock"].clock)


def look(running, wall_s):
    """Call the timers, some wall time later."""
    running.wait(wall_s)
    running.call_timers()


def test_a_world_without_a_processor_for_long_sends_its_tick_again_and_goes_on():
    with driven_world() as (running, robots), driver_of(robots[0]), driver_of(robots[1]):
        n_sent = running.published["clock"]
        look(running, 1000.0)
        assert running.published["clock"] == n_sent + 1
        assert not running.node.finished.done()
        assert time_after_commands(running, robots) == 0.05


def test_the_time_in_which_a_world_is_paused_is_no_silence():
    with driven_world() as (running, robots), driver_of(robots[0]), driver_of(robots[1]):
        for paused in (True, False):
            running.call("pause", SetBool.Request(data=paused))
            for _ in range(9):
                look(running, 1.0)
        assert not running.node.finished.done()
        assert time_after_commands(running, robots) == 0.05


def test_a_robot_is_waited_for_again_once_its_driver_is_there_again():
    with driven_world() as (running, robots), driver_of(robots[0]):
        look(running, 1.0)
        assert time_after_commands(running, robots[:1]) == 0.05
        with driver_of(robots[1]):
            assert time_after_commands(running, robots[:1]) == 0.1
            assert time_after_commands(running, robots[:1]) == 0.1
            assert time_after_commands(running, robots) == pytest.approx(0.15)


def test_a_world_without_drivers_goes_on_once_they_are_there_again():
    with driven_world() as (running, robots):
        for _ in range(20):
            look(running, 1.0)
        assert time_after_commands(running, robots) == 0.0
        with driver_of(robots[0]), driver_of(robots[1]):
            look(running, 1.0)
            assert time_after_commands(running, robots) == 0.05
        assert not running.node.finished.done()


@pytest.mark.parametrize("lockstep", [True, False])
def test_a_start_area_without_room_for_all_robots_ends_the_node(lockstep, capsys):
    robots = [f"robot{number}" for number in range(25)]
    with node_in_process("hallway_sim", robots=robots, lockstep=lockstep, people=0) as running:
        if lockstep:
            success, message = ask(NodeInProcess(running.node.companions[0]))
            assert not success
            assert "start fewer robots" in message
        else:
            running.call_timers()
        assert running.node.finished.result() == BAD_INPUT
        assert "hallway_sim: start area 'train' must have room" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("robots", "options", "sentence"),
    [
        (["a", "/a"], {}, "robots must be different names, got /a, /a"),
        (["a b"], {}, "namespace must be letters, digits, _ and /"),
        (["a"], {"frame_prefix": "b/"}, "frame_prefix must be empty where robots are given"),
        (["a"], {"remappings": ["__ns:=/fleet"]}, "must have no namespace, got /fleet"),
    ],
)
def test_names_that_robots_cannot_have_are_refused(robots, options, sentence):
    with (
        pytest.raises(NodeError, match=sentence),
        node_in_process("hallway_sim", robots=robots, **options),
    ):
        pass
