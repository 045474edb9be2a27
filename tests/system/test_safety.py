"""Live mode: plain Twist drives the robot, and silence or NaN stops it within 0.5 s.

Time is simulated, which follows real time. A busy machine delivers messages later; the time that
threads have waited for a processor is measured and added to the limit.
"""

import math

import pytest
from geometry_msgs.msg import PoseStamped, Twist, Vector3Stamped
from nav_msgs.msg import Odometry
from visualization_msgs.msg import MarkerArray

from serd_core.grid.grid import Action
from serd_ros.convert.command import to_intent
from serd_ros.convert.pose import from_odometry, from_pose
from serd_ros.convert.stamp import stamp_s
from serd_ros.endpoints import qos
from serd_sim.scenario.scenario import load_scenario
from support.waiting import ProcessorWait
from support.wheeled_robots import STOPPED_MPS

pytestmark = [pytest.mark.ros, pytest.mark.slow]


class Robot:
    """Commands the robot and takes its odometry."""

    def __init__(self, probe):
        self.probe = probe
        self.speed_mps = self.time_s = math.nan
        self.commands = probe.node.create_publisher(Twist, "cmd_vel", qos.COMMAND)
        probe.node.create_subscription(Odometry, "odom", self._take, qos.STATE)

    def _take(self, message):
        self.speed_mps = from_odometry(message)[2][0]
        self.time_s = stamp_s(message.header.stamp)

    def command(self, linear, angular=0.0):
        message = Twist()
        message.linear.x, message.angular.z = linear, angular
        self.commands.publish(message)

    def spin_round(self):
        """Turn on the spot while creeping, so that no wall is ever reached; until it moves."""
        self.probe.spin_until(lambda: self.commands.get_subscription_count() > 0)

        def moving():
            self.command(0.2, 2.0)
            return self.speed_mps > 0.15

        self.probe.spin_until(moving)


@pytest.fixture
def robot(nodes, probe):
    environment = nodes.start_stack("live", seed=2)
    environment["local_planner"].terminate()
    environment["local_planner"].wait()
    robot = Robot(probe)
    probe.spin_until(lambda: not math.isnan(robot.speed_mps))
    return robot


def test_a_plain_twist_drives_and_silence_stops_within_half_a_second(robot, probe):
    robot.spin_round()
    probe.spin_all()
    silent_since_s, waited = robot.time_s, ProcessorWait()
    probe.spin_until(lambda: abs(robot.speed_mps) < STOPPED_MPS)
    # 0.5 s of silence, then braking, of which that of the turn takes longest. The last command
    # comes up to a period after the last odometry, mux and world step once a period, and the robot
    # settles on its wheels for one.
    scenario = load_scenario("hallway")
    braking_s = 2.0 / scenario.robot.acc_lim_theta_radps2
    limit_s = 0.5 + braking_s + 4 * scenario.control_period_s
    assert robot.time_s - silent_since_s <= limit_s + waited.total_s


@pytest.mark.parametrize("people_from", ["given", "scan"])
def test_an_intent_drives_the_robot_into_the_next_cell_in_real_time(nodes, probe, people_from):
    nodes.start_stack("live", seed=2, people_from=people_from)
    poses = []
    probe.node.create_subscription(
        PoseStamped, "robot_pose", lambda m: poses.append(from_pose(m.pose)), qos.STATE
    )
    shown = []
    probe.node.create_subscription(MarkerArray, "markers/people", shown.append, qos.STATE)
    intents = probe.node.create_publisher(Vector3Stamped, "intent", qos.COMMAND)
    probe.spin_until(lambda: poses and intents.get_subscription_count() > 0)
    start_x_m = poses[-1][0]
    intents.publish(to_intent(Action.EAST, 0.0))
    next_centre_m = math.floor(start_x_m) + 1.5
    probe.spin_until(lambda: abs(poses[-1][0] - next_centre_m) < 0.2)
    assert {len(each.markers[0].points) for each in shown} == {24}


def test_a_command_that_is_not_finite_stops_at_once(robot, probe):
    robot.spin_round()
    probe.spin_all()
    commanded_s, waited = robot.time_s, ProcessorWait()
    robot.command(math.nan, 2.0)
    probe.spin_until(lambda: abs(robot.speed_mps) < STOPPED_MPS)
    assert robot.time_s - commanded_s <= 0.5 + waited.total_s
