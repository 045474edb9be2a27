"""The teleop nodes over ROS: priorities of the mux, and the joystick."""

import math

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, TwistStamped
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from serd_cli.processes.node_commands import stack_processes
from serd_ros.convert.diagnostics import values_of
from serd_ros.endpoints import qos
from serd_ros.graph.graph import Stack, find_stack

pytestmark = pytest.mark.ros


def start(nodes, environment, names, *, forked=True, **given):
    """Start some nodes of the teleop stack."""
    part = find_stack("teleop").model_copy(update={"nodes": names})
    return {
        each.name: nodes.start(list(each.command), each.name, forked=forked)
        for each in stack_processes(part, given, environment)
    }


class Commander:
    """Publishes velocities and takes those of the mux."""

    def __init__(self, probe):
        self.probe = probe
        self.linear, self.state = math.nan, {}
        probe.node.create_subscription(DiagnosticArray, "diagnostics", self._take_report, qos.STATE)
        probe.node.create_subscription(Twist, "cmd_vel_raw", self._take, qos.COMMAND)
        self.inputs = {
            name: probe.node.create_publisher(Twist, f"cmd_vel_{name}", qos.COMMAND)
            for name in ("planner", "teleop", "joy")
        }
        self.gone = probe.node.create_publisher(Bool, "driver_gone", qos.COMMAND)
        self.e_stop = probe.node.create_publisher(Bool, "e_stop", qos.COMMAND)
        every = [*self.inputs.values(), self.gone, self.e_stop]
        probe.spin_until(lambda: all(each.get_subscription_count() for each in every))

    def _take(self, message):
        self.linear = message.linear.x

    def _take_report(self, message):
        self.state = values_of(message, "teleop_mux") or self.state

    def until(self, reached, **speeds):
        """Send these speeds until the output is reached."""

        def done():
            for name, speed in speeds.items():
                message = Twist()
                message.linear.x = speed
                self.inputs[name].publish(message)
            return self.linear == pytest.approx(reached, abs=1e-9)

        self.probe.spin_until(done)

    def until_none_is_held(self):
        """Send stops until each has arrived: of several commands a busy mux takes the last."""

        def done():
            for each in self.inputs.values():
                each.publish(Twist())
            return self.state.get("held") == ""

        self.probe.spin_until(done)


@pytest.fixture
def commander(nodes, probe, ros_env):
    start_mux(nodes, ros_env)
    return Commander(probe)


def start_mux(nodes, environment, **given):
    alone = Stack(about="the mux alone", nodes=("teleop_mux",))
    (process,) = stack_processes(alone, given, environment)
    return nodes.start(list(process.command), "teleop_mux")


def test_the_mux_lets_the_highest_priority_drive_and_stops_when_all_are_silent(commander):
    commander.until(0.0)
    commander.until(0.4, teleop=0.4, planner=0.2)
    commander.until(0.7, joy=0.7, teleop=0.4, planner=0.2)
    commander.until(0.0)


def test_the_planner_drives_only_while_a_driver_is_present(commander):
    commander.until(0.0, planner=0.3)

    def there():
        commander.gone.publish(Bool(data=False))
        message = Twist()
        message.linear.x = 0.3
        commander.inputs["planner"].publish(message)
        return commander.linear == pytest.approx(0.3)

    commander.probe.spin_until(there)
    commander.gone.publish(Bool(data=True))
    commander.until(0.0, planner=0.3)


def test_the_e_stop_holds_until_the_service_releases_it_and_speeds_are_limited(commander):
    commander.until(1.2, teleop=50.0)
    commander.e_stop.publish(Bool(data=True))
    commander.until(0.0, teleop=0.5)
    for _ in range(10):
        commander.until(0.0, teleop=0.5, joy=0.5)
    commander.probe.spin_until(lambda: commander.state.get("held"))
    service = commander.probe.node.create_client(SetBool, "set_e_stop")
    commander.probe.spin_until(service.service_is_ready)
    reply = service.call_async(SetBool.Request(data=False))
    commander.probe.spin_until(reply.done)
    assert reply.result().message == "released"
    for _ in range(10):
        commander.until(0.0, teleop=0.5, joy=0.5)  # they did not stop in between
    commander.until_none_is_held()
    commander.until(0.5, teleop=0.5)


def test_a_command_that_is_not_finite_stops(commander):
    commander.until(0.5, teleop=0.5)
    commander.until(0.0, teleop=math.nan)


def test_commands_have_stamps_where_the_file_sets_it(nodes, probe, ros_env, tmp_path):
    file = tmp_path / "mux.yaml"
    file.write_text("topics: {nav: {topic: nav_vel, timeout: 0.5, priority: 1, stamped: true}}\n")
    start_mux(nodes, ros_env, mux=str(file), stamped_cmd_vel=True)
    speeds = []
    probe.node.create_subscription(
        TwistStamped, "cmd_vel_raw", lambda m: speeds.append(m.twist.linear.x), qos.COMMAND
    )
    publisher = probe.node.create_publisher(TwistStamped, "nav_vel", qos.COMMAND)

    def driven():
        message = TwistStamped()
        message.twist.linear.x = 0.25
        publisher.publish(message)
        return speeds and speeds[-1] == 0.25

    probe.spin_until(driven)


def test_a_joystick_drives_while_its_enable_button_is_held(nodes, probe, ros_env):
    start(nodes, ros_env, ("teleop_joy",), forked=False)
    received = []
    probe.node.create_subscription(Twist, "cmd_vel_joy", received.append, qos.COMMAND)
    publisher = probe.node.create_publisher(Joy, "joy", qos.COMMAND)
    probe.spin_until(lambda: publisher.get_subscription_count() > 0)

    def driven():
        publisher.publish(Joy(axes=[0.0, 0.0, 0.0], buttons=[0] * 6))
        publisher.publish(Joy(axes=[0.0, 1.0, -0.5], buttons=[0, 0, 0, 0, 1, 0]))
        return received and received[-1].linear.x != 0.0

    probe.spin_until(driven)
    assert (received[-1].linear.x, received[-1].angular.z) == pytest.approx((0.6, -0.75))
    publisher.publish(Joy(axes=[0.0, 1.0, -0.5], buttons=[0] * 6))
    probe.spin_until(lambda: received[-1].linear.x == 0.0)


def test_after_the_release_of_the_e_stop_the_stick_must_return_to_neutral(nodes, probe, ros_env):
    start(nodes, ros_env, ("teleop_joy", "teleop_mux"))
    received = []
    probe.node.create_subscription(Twist, "cmd_vel_joy", received.append, qos.COMMAND)
    e_stop = probe.node.create_publisher(Bool, "e_stop", qos.COMMAND)
    publisher = probe.node.create_publisher(Joy, "joy", qos.COMMAND)
    engaged = []
    probe.node.create_subscription(
        Bool, "e_stop_engaged", lambda m: engaged.append(m.data), qos.LATCHED
    )
    probe.spin_until(
        lambda: publisher.get_subscription_count() and e_stop.get_subscription_count() and engaged
    )

    def push(deflection):
        publisher.publish(Joy(axes=[0.0, deflection, 0.0], buttons=[0, 0, 0, 0, 1, 0]))
        return received[-1].linear.x if received else 0.0

    probe.spin_until(lambda: push(0.0) == 0.0 and received)
    probe.spin_until(lambda: push(1.0) > 0.0)
    for state in (True, False):
        e_stop.publish(Bool(data=state))
        probe.spin_until(lambda state=state: engaged[-1] == state)
    probe.spin_until(lambda: push(1.0) == 0.0)
    received.clear()
    probe.spin_until(lambda: push(1.0) == 0.0 and len(received) > 20)
    assert all(each.linear.x == 0.0 for each in received)
    received.clear()  # more than may wait: of several messages a busy node takes the last alone
    probe.spin_until(lambda: push(0.0) == 0.0 and len(received) > 20)
    probe.spin_until(lambda: push(1.0) > 0.0)
