"""Whom a world with several robots waits for: before an episode, and before each of its steps."""

from contextlib import contextmanager

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from std_srvs.srv import Trigger

from serd_ros.convert.command import to_twist_stamped
from serd_ros.convert.stamp import stamp_s
from serd_ros.errors import NodeError
from serd_ros.graph.readiness import PATIENCE_S
from serd_ros.process.serd_node import BAD_INPUT
from sim.world.command import Command
from support.nodes_in_process import NodeInProcess, node_in_process
from support.waiting import wait_until

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
