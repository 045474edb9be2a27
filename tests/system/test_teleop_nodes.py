"""The teleop nodes over ROS: priorities of the mux, joystick, keyboard and its terminal."""

import math
import os
import pty
import signal
import termios

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, TwistStamped, Vector3Stamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from serd_cli.processes.node_commands import stack_processes
from serd_core.grid.grid import Action
from serd_ros.convert.command import from_intent
from serd_ros.convert.diagnostics import to_diagnostics, values_of
from serd_ros.convert.pose import from_odometry
from serd_ros.convert.stamp import stamp_s
from serd_ros.endpoints import qos
from serd_ros.graph.graph import Stack, find_stack
from support.waiting import PATIENCE_S, ProcessorWait
from support.wheeled_robots import STOPPED_MPS

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


class Drive:
    """The motion of the robot, and the keys that drive it."""

    def __init__(self, probe, terminal):
        self.probe, self._terminal = probe, terminal
        self.time_s, self.speed_mps, self.speeds_mps = 0.0, 0.0, []
        probe.node.create_subscription(Odometry, "odom", self._take, qos.STATE)

    def _take(self, message):
        self.time_s, self.speed_mps = (
            stamp_s(message.header.stamp),
            abs(from_odometry(message)[2][0]),
        )
        self.speeds_mps.append(self.speed_mps)

    def until(self, condition, key=b""):
        """Until the condition holds, with a key that is held: the terminal repeats it."""

        def press():
            if key:
                self._terminal.type(key)
            return condition()

        self.probe.spin_until(press)

    def until_it_drives(self, key):
        """Hold a key; press it anew while the robot stands, as a node that is late stops it."""
        while self.speed_mps < 0.2:
            self.until_later(1.0)
            self.until_later(3.0, key, or_if=lambda: self.speed_mps >= 0.2)

    def until_later(self, duration_s, key=b"", or_if=lambda: False):
        since_s = self.time_s
        self.until(lambda: self.time_s > since_s + duration_s or or_if(), key)

    def stands_for(self, duration_s, key=b""):
        self.probe.spin_all()
        self.speeds_mps.clear()
        self.until_later(duration_s, key)
        assert max(self.speeds_mps) < STOPPED_MPS


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "key"), [("directions", b"\x1b[A"), ("velocity", b"i")])
def test_after_the_release_of_the_e_stop_keys_of_a_terminal_must_be_pressed_anew(
    nodes, probe, ros_env, terminal, mode, key
):
    names = ("hallway_sim", "local_planner", "teleop_mux", "guard", "teleop_keyboard")
    start(nodes, ros_env, names, terminal=terminal.name, people=0, seed=2, mode=mode)
    drive = Drive(probe, terminal)

    def log():
        return nodes.log_of("teleop_keyboard")

    drive.until(lambda: drive.time_s and "Ctrl-C end" in log())
    drive.until_it_drives(key)
    terminal.type(b" ")
    drive.until(lambda: drive.speed_mps < STOPPED_MPS and "E-STOP engaged" in log(), key)
    terminal.type(b"r")
    drive.until(lambda: "e-stop released" in log(), key)
    drive.stands_for(2.5, key)  # held through the release
    drive.until_it_drives(key)
    terminal.type(b" ")
    drive.until(lambda: drive.speed_mps < STOPPED_MPS and log().count("E-STOP engaged") == 2)
    terminal.type(key)
    drive.stands_for(3.0)
    terminal.type(b"r")
    drive.until(lambda: log().count("e-stop released") == 2)
    drive.stands_for(2.5)  # a tap while stopped
    drive.until_it_drives(key)


@pytest.mark.slow
def test_the_planner_remains_locked_after_its_silence_until_a_key_is_pressed_anew(
    nodes, probe, ros_env, terminal
):
    """This test is the mux; a planner that continues may have lost the intent to wait."""
    start(nodes, ros_env, ("hallway_sim", "teleop_keyboard"), terminal=terminal.name, people=0)
    gone = []
    probe.node.create_subscription(Bool, "driver_gone", lambda m: gone.append(m.data), qos.COMMAND)
    mux = probe.node.create_publisher(DiagnosticArray, "diagnostics", qos.STATE)
    drive = Drive(probe, terminal)
    up = b"\x1b[A"

    def report(active):
        mux.publish(to_diagnostics("teleop_mux", drive.time_s, {"active": active}))

    def until_later(duration_s, active, key=b""):
        until_s = drive.time_s + duration_s
        while drive.time_s < until_s:
            report(active)
            drive.until_later(0.1, key)

    def press_until_unlocked():
        gone.clear()
        while False not in gone:
            until_later(1.0, "planner")  # released; a node that is late discards what is held
            until_later(2.5, "planner", up)

    drive.until(lambda: drive.time_s and "Ctrl-C end" in nodes.log_of("teleop_keyboard"))
    press_until_unlocked()
    report("")
    drive.until(lambda: gone[-1], up)
    until_later(0.2, "", up)
    gone.clear()
    until_later(2.5, "", up)  # still held
    until_later(1.0, "")
    assert False not in gone
    press_until_unlocked()


class Terminal:
    """A pseudo terminal; `person` is the end for typing."""

    def __init__(self):
        self.person, self._device = pty.openpty()
        self.name = os.ttyname(self._device)
        self.before = self.settings()

    def settings(self):
        return termios.tcgetattr(self._device)

    def type(self, keys):
        os.write(self.person, keys)

    def close(self):
        os.close(self.person)
        os.close(self._device)


@pytest.fixture
def terminal():
    terminal = Terminal()
    yield terminal
    terminal.close()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_the_keyboard_restores_the_terminal_on_every_signal(
    nodes, probe, ros_env, terminal, number
):
    process = start(nodes, ros_env, ("teleop_keyboard",), terminal=terminal.name)["teleop_keyboard"]
    probe.spin_until(lambda: "Ctrl-C end" in nodes.log_of("teleop_keyboard"))
    assert terminal.settings() != terminal.before
    process.send_signal(number)
    assert process.wait(PATIENCE_S) == 0
    assert terminal.settings() == terminal.before


def test_without_a_terminal_the_keyboard_ends_with_an_error_message(nodes, ros_env):
    process = start(nodes, ros_env, ("teleop_keyboard",), terminal="/dev/null")["teleop_keyboard"]
    assert process.wait(PATIENCE_S) == 2
    assert "start it in a terminal window" in nodes.log_of("teleop_keyboard")


@pytest.mark.slow
def test_arrow_keys_drive_and_a_killed_keyboard_stops_the_robot(nodes, probe, ros_env, terminal):
    names = ("hallway_sim", "local_planner", "teleop_mux", "guard", "teleop_keyboard")
    running = start(nodes, ros_env, names, terminal=terminal.name, people=0, seed=2)
    motion, actions, sent = [], [], {}
    for topic in ("cmd_vel", "cmd_vel_planner"):
        probe.node.create_subscription(
            Twist, topic, lambda m, topic=topic: sent.update({topic: m.linear.x}), qos.COMMAND
        )
    probe.node.create_subscription(
        Odometry,
        "odom",
        lambda m: motion.append((stamp_s(m.header.stamp), from_odometry(m)[2][0])),
        qos.STATE,
    )
    probe.node.create_subscription(
        Vector3Stamped, "intent", lambda m: actions.append(from_intent(m)[1]), qos.STATE
    )
    mux = {}
    probe.node.create_subscription(
        DiagnosticArray,
        "diagnostics",
        lambda m: mux.update(values_of(m, "teleop_mux") or {}),
        qos.STATE,
    )
    probe.spin_until(lambda: motion and "Ctrl-C end" in nodes.log_of("teleop_keyboard"))

    drive = Drive(probe, terminal)
    drive.until_it_drives(b"\x1b[A")
    assert set(actions) <= {Action.NORTH, Action.WAIT}
    assert Action.NORTH in actions
    probe.spin_all()
    killed_s, waited = motion[-1][0], ProcessorWait()
    running["teleop_keyboard"].kill()
    probe.spin_until(lambda: sent["cmd_vel"] == 0.0)
    assert sent["cmd_vel_planner"] > 0.1  # the planner alone would continue
    probe.spin_until(lambda: abs(motion[-1][1]) < STOPPED_MPS)
    # The lock engages after 0.5 s of silence, then the robot brakes; odometry follows.
    assert motion[-1][0] - killed_s <= 0.5 + 1.2 / 2.5 + 0.15 + waited.total_s
    # Where the mux is late, the guard stands the robot before the lock does.
    probe.spin_until(lambda: mux["locked_by"] and abs(motion[-1][1]) < STOPPED_MPS)
    stopped_s, n_before = motion[-1][0], len(motion)
    probe.spin_until(lambda: motion[-1][0] > stopped_s + 0.5)
    assert all(abs(speed_mps) < STOPPED_MPS for _, speed_mps in motion[n_before:])
