"""Episodes by request, steps by command in lock-step, and the URDF of the robot."""

import math
from contextlib import contextmanager, nullcontext
from functools import partial
from xml.etree import ElementTree

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, Vector3
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import Trigger

from serd_app.drives.drive import START, EpisodeMark
from serd_bag.formats.rosbag2.message_types import rosbags_types
from serd_bag.messages.plain import transforms
from serd_ros.convert.diagnostics import to_episode_message
from serd_ros.convert.frames import Frames
from serd_ros.convert.motion import to_goal_area_message, to_twist_stamped
from serd_ros.convert.stamp import stamp_s
from serd_ros.endpoints import qos
from serd_ros.endpoints.topic_types import TF_TYPE, TopicType
from serd_ros.graph.graph import PATIENCE_S
from serd_ros.process.serd_node import BAD_INPUT
from serd_sim.episodes.episode import EpisodeStart
from serd_sim.robot.urdf import BUILTIN_URDF
from serd_sim.world.command import Command
from support.nodes_in_process import node_in_process
from support.waiting import wait_until


def world(**parameters):
    """The node of a world without people."""
    return node_in_process("hallway_sim", people=0, **parameters)


@contextmanager
def driver_of(robot):
    """A node that publishes episodes of a robot."""
    driver = rclpy.create_node("scripted_expert")
    driver.create_publisher(DiagnosticArray, "episode", 1)
    known = driver.get_name(), driver.get_namespace()
    wait_until(lambda: known in robot.node.get_node_names_and_namespaces())
    wait_until(lambda: robot.node.count_publishers("episode"))
    try:
        yield
    finally:
        driver.destroy_node()


def test_the_urdf_and_a_path_from_each_of_its_links_to_the_base_are_latched():
    kinds, taken = {"robot_description": String, "tf_static": TopicType(TF_TYPE).message}, {}
    with world(frame_prefix="robot1/"):
        viewer = rclpy.create_node("viewer")  # which joins late
        for topic, kind in kinds.items():
            take = partial(taken.__setitem__, topic)
            viewer.create_subscription(kind, topic, take, qos.LATCHED, raw=True)
        wait_until(lambda: len(taken) == 2, turn=lambda: rclpy.spin_once(viewer, timeout_sec=0.1))
        viewer.destroy_node()
    text, frames = deserialize_message(taken["robot_description"], String).data, Frames()
    for each in transforms(taken["tf_static"], TF_TYPE, rosbags_types()):
        frames.take(each, static=True)
    assert text == BUILTIN_URDF.read_text(encoding="utf-8")
    links = {each.get("name") for each in ElementTree.fromstring(text).findall("link")}
    assert {f"robot1/{link}" for link in links} == set(frames.names)
    placed = {link: frames.place(f"robot1/{link}", "robot1/base_link") for link in links}
    assert [each.stamp_ns for each in placed.values()] == [None] * 5
    assert placed["right_wheel"].matrix[:3, 3] == pytest.approx([0.0, -0.16, 0.08])


def ask(robot):
    response = robot.call("reset", Trigger.Request())
    return response.success, response.message


def episode_of(answer):
    success, message = answer
    assert success, message
    return EpisodeStart.model_validate_json(message)


def look(running, wall_s, times=1):
    """Call the timers, some wall time later."""
    for _ in range(times):
        running.wait(wall_s)
        running.call_timers()


def time_after_command(running):
    """The time of the world after a command for its present tick."""
    command = to_twist_stamped(Command(0.2, 0.0), stamp_s(running.sent["clock"].clock))
    running.receive("cmd_vel", command)
    return stamp_s(running.sent["clock"].clock)


def test_a_request_waits_for_required_nodes_which_are_named():
    with world(lockstep=True, required_nodes=["scripted_expert"]) as running:
        assert ask(running) == (False, "node scripted_expert")
        with driver_of(running):
            assert not ask(running)[0]
            running.wait(PATIENCE_S)
            assert episode_of(ask(running)).episode == 0


@pytest.fixture
def begun():
    """A world in its first episode, which waits ten seconds for a command."""
    with world(lockstep=True, lockstep_timeout_s=10.0) as running, driver_of(running):
        assert ask(running)[0]
        yield running


def test_a_world_without_an_answer_ends_and_names_the_topic(begun, capsys):
    look(begun, 1.0, times=11)
    assert begun.node.finished.result() == BAD_INPUT
    assert "arrived on /cmd_vel within lockstep_timeout_s = 10 s" in capsys.readouterr().err


def test_a_world_without_a_processor_for_long_sends_its_tick_again_and_goes_on(begun):
    n_sent = begun.published["clock"]
    look(begun, 1000.0)
    assert begun.published["clock"] == n_sent + 1
    assert not begun.node.finished.done()
    assert time_after_command(begun) == 0.05


def test_a_robot_in_its_goal_is_not_waited_for_until_the_goal_is_elsewhere(begun):
    for first_m, last_m, time_s in ((-100.0, 100.0, 0.05), (90.0, 100.0, 0.1)):
        corners = (first_m, first_m), (last_m, first_m), (last_m, last_m), (first_m, last_m)
        begun.receive("goal_area", to_goal_area_message(corners, 0.0))
        assert time_after_command(begun) == time_s
        if first_m < 0.0:
            assert time_after_command(begun) == time_s


def test_a_request_of_a_driver_that_received_no_response_gets_the_same_episode(begun):
    start = episode_of(ask(begun))
    assert start.episode == 0
    mark = EpisodeMark(START, start.start_s, start.episode)  # as a driver publishes it
    begun.receive("episode", to_episode_message(mark))
    assert time_after_command(begun) == 0.05
    assert episode_of(ask(begun)).episode == 1


@pytest.mark.parametrize(
    ("has_driver", "between", "episodes"),
    [
        (False, "", [0, 1]),  # where no node marks episodes, each request begins one
        (True, "", [0, 0]),
        (True, "drive", [0, 1]),
        (True, "turn", [0, 0]),  # a heading on the other side of 180 degrees is no motion
    ],
)
def test_a_request_by_hand_begins_an_episode_once_the_robot_has_moved(
    has_driver, between, episodes
):
    with world() as running, driver_of(running) if has_driver else nullcontext():
        found = [ask(running)]
        if between == "drive":
            running.receive("cmd_vel", Twist(linear=Vector3(x=0.5)))
            for _ in range(5):
                running.call_timers()
        elif between == "turn":
            x_m, y_m, yaw_rad = running.node._start_pose
            running.node._start_pose = x_m, y_m, yaw_rad + math.tau
        found.append(ask(running))
        assert [episode_of(each).episode for each in found] == episodes


@pytest.mark.parametrize("lockstep", [True, False])
def test_a_start_area_that_the_scenario_lacks_ends_the_node(lockstep, capsys):
    with world(lockstep=lockstep, start_area="trian") as running:
        if lockstep:
            success, message = ask(running)
            assert not success
            assert "did you mean 'train'" in message
        else:
            running.call_timers()
        assert running.node.finished.result() == BAD_INPUT
        assert "did you mean 'train'" in capsys.readouterr().err


def test_a_live_world_stops_its_robot_after_silence_and_at_a_command_that_is_not_finite():
    with world() as running:
        ask(running)

        def speed_after(n_periods, *commands_mps):
            for speed_mps in commands_mps:
                running.receive("cmd_vel", Twist(linear=Vector3(x=speed_mps)))
            for _ in range(n_periods):
                running.call_timers()
            return running.sent["odom"].twist.twist.linear.x

        for stop in ((8,), (4, math.nan)):
            assert speed_after(3, 0.3) > 0.1
            assert abs(speed_after(*stop)) < 0.02
        running.assert_alive()


def beside_another_clock(running):
    made = running.node.create_publisher(Clock, "/clock", qos.CLOCK)
    wait_until(lambda: running.node.count_publishers("/clock") == 2)
    return made


def test_a_world_does_not_begin_beside_another_silent_clock_and_ends_after_a_while(capsys):
    with world() as running:
        clock = beside_another_clock(running)
        look(running, 20.0)
        assert not running.published["clock"]
        running.node.destroy_publisher(clock)
        wait_until(lambda: running.node.count_publishers("/clock") == 1)
        look(running, 1.0)
        assert running.published["clock"] == 1

    with world() as running:
        beside_another_clock(running)
        look(running, 26.0)
        assert running.node.finished.result() == BAD_INPUT
    assert "there must be one publisher of /clock, got 2" in capsys.readouterr().err
