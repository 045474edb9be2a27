"""Nodes that are killed or stopped while the robot drives.

The nodes of a stack run each by itself, so that the others continue when one of them ends, as they
do on a robot. Time is that of the stamps. The time that threads waited for a processor is added to
each limit.
"""

import math
import signal
import time

import pytest
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from nav_msgs.msg import Odometry

from serd_core.grid.grid import Action
from serd_ros.convert.diagnostics import OK
from serd_ros.convert.motion import from_odometry, from_pose_stamped, to_intent, to_pose_stamped
from serd_ros.endpoints import qos
from support.waiting import ProcessorWait
from support.wheeled_robots import STOPPED_MPS

pytestmark = [pytest.mark.ros, pytest.mark.slow]
KILL, STOP = signal.SIGKILL, signal.SIGSTOP
#: The dead-man's switches take 0.2 s, braking from 1.2 m/s 0.2 s; a tick and the transport.
CHAIN_S = 0.2 + 1.2 / 6.0 + 0.1
#: A waypoint is recent for 0.8 s, and the planner brakes with 2.5 m/s².
SOURCE_S = 0.8 + 1.2 / 2.5 + 0.2
#: An action ends in the next cell, 1.5 m ahead at most.
ACTION_S = 4.0
#: The source of intents of the stack live, which this process is.
SOURCE = "source of intents"
SILENCE_S, WATCHED_S, RESUMED_S = 2.0, 10.0, 3.0


class Driven:
    """A robot that the source of a stack drives towards north without people.

    The source is a goal of the strategy (goto) or this process (live). way_m: driven so far;
    reports: warnings on `diagnostics`, as `node: message`.
    """

    def __init__(self, stack, nodes, probe, **given):
        self._stack, self._nodes, self._probe = stack, nodes, probe
        self.time_s, self.speed_mps, self.way_m = math.nan, 0.0, 0.0
        self._heard_s, self._place_m = time.monotonic(), None
        self._publishes, self._due_s = True, 0.0
        self._health = probe.health()
        probe.subscribe(Odometry, "odom", self._take_odometry)
        probe.subscribe(PoseStamped, "robot_pose", self._take_pose)
        self._intents = probe.node.create_publisher(Vector3Stamped, "intent", qos.COMMAND)
        self._goals = probe.node.create_publisher(PoseStamped, "goal_pose", qos.COMMAND)
        self._processes = nodes.start_stack(stack, people=0, **given)

    def drive(self):
        """Drive faster than 0.4 m/s.

        A goal is sent again, as a reader of a killed node is known for a while.
        """
        self._publishes, sent_s = True, -math.inf

        def drives():
            nonlocal sent_s
            if time.monotonic() > sent_s + 4.0:
                self._goals.publish(to_pose_stamped((12.0, 18.0, 0.0), 0.0))
                sent_s = time.monotonic()
            return self.speed_mps > 0.4

        self._spin(drives)

    def inject(self, node, number):
        """Send a signal to a node, or end the source; time and way until the robot stands.

        The time is infinite where the robot still drives after 10 s, NaN where the stamps end.
        """
        self._health.clear()
        since_s, before_m = self.time_s, self.way_m
        if node == SOURCE:
            self._publishes = False
        else:
            self._processes[node].send_signal(number)
        self._heard_s = time.monotonic()
        watched = self._while_stamps_come(
            lambda: self.speed_mps < STOPPED_MPS or self.time_s > since_s + WATCHED_S
        )
        after_s = self.time_s - since_s if watched else math.nan
        if watched and self.speed_mps >= STOPPED_MPS:
            after_s = math.inf
        distance_m, until_s = self.way_m - before_m, self.time_s + 1.0
        self._while_stamps_come(lambda: self.time_s > until_s)
        return after_s, distance_m

    def resumes(self, node):
        """Continue a stopped node; whether the robot drives within some simulated seconds."""
        self._processes[node].send_signal(signal.SIGCONT)
        self._spin(lambda: time.monotonic() - self._heard_s < 0.1)
        since_s = self.time_s
        self._spin(lambda: self.speed_mps > 0.1 or self.time_s > since_s + RESUMED_S)
        return self.speed_mps > 0.1

    def _while_stamps_come(self, condition):
        """Until the condition holds or odom is silent; whether the condition held."""
        self._spin(lambda: condition() or time.monotonic() - self._heard_s > SILENCE_S)
        return condition()

    def _spin(self, condition):
        def publish_and_look():
            if self._stack == "live" and self._publishes and self.time_s >= self._due_s:
                self._due_s = self.time_s + 0.5
                self._intents.publish(to_intent(Action.NORTH, self.time_s))
            return condition()

        self._probe.spin_until(publish_and_look, seen=lambda: (self.time_s, self.speed_mps))

    def _take_odometry(self, message):
        stamp_ns, _, (speed_mps, _) = from_odometry(message)
        self.time_s, self.speed_mps = stamp_ns * 1e-9, abs(speed_mps)
        self._heard_s = time.monotonic()

    def _take_pose(self, message):
        place_m = from_pose_stamped(message)[1][:2]
        self.way_m += math.dist(place_m, self._place_m or place_m)
        self._place_m = place_m

    @property
    def reports(self):
        return [f"{each.name}: {each.message}" for each in self._health if each.level != OK]


@pytest.fixture
def driven(nodes, probe):
    """Makes a robot that a stack drives."""

    def drive(stack, **given):
        robot = Driven(stack, nodes, probe, **given)
        robot.drive()
        return robot

    return drive


def test_the_robot_stands_while_its_strategy_is_silent_and_after_its_planner_died(
    driven, save_model_of
):
    robot = driven("goto", model=str(save_model_of()))
    for node, number, limit_s in (("strategy", STOP, SOURCE_S), ("local_planner", KILL, CHAIN_S)):
        robot.drive()
        waited = ProcessorWait()
        after_s, _ = robot.inject(node, number)
        assert after_s <= limit_s + waited.total_s, node
        if number == STOP:
            assert "local_planner: no recent waypoint" in robot.reports
            assert robot.resumes(node)


def test_a_silent_source_ends_the_motion_in_its_cell_and_a_lost_world_stops_the_planner(driven):
    robot = driven("live")
    waited = ProcessorWait()
    after_s, distance_m = robot.inject(SOURCE, STOP)
    assert after_s <= ACTION_S + waited.total_s
    assert distance_m <= 1.5 + 1.2 * waited.total_s
    robot.drive()
    robot.inject("hallway_sim", STOP)
    assert any(each.startswith("local_planner: stale") for each in robot.reports)
