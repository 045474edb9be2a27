"""Managed nodes go through their states by the services that a lifecycle manager calls."""

import importlib.util
import signal

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry

from serd_bag.reader import BagReader
from serd_cli.processes.node_commands import node_command
from serd_ros.convert.diagnostics import values_of
from serd_ros.convert.pose import to_pose_stamped
from serd_ros.endpoints import qos
from serd_ros.graph.configs import CONFIGS, ManagedConfig
from serd_ros.graph.graph import load_graph
from support.goals import Goals
from support.lifecycle import DOWN, UP, LifecycleManager

pytestmark = [pytest.mark.ros, pytest.mark.slow]
MANAGED = sorted(name for name, kind in CONFIGS.items() if issubclass(kind, ManagedConfig))
needs_nav2 = pytest.mark.skipif(
    importlib.util.find_spec("nav2_msgs") is None,
    reason="nav2_msgs is not installed; run make interfaces",
)


@pytest.fixture
def start(nodes, ros_env, tmp_path, save_model_of):
    """Starts a managed node with these parameters over those that it needs."""
    needed = {
        "strategy": {"model": str(save_model_of())},
        "demo_recorder": {"output": str(tmp_path / "bag")},
        "learner": {"output": str(tmp_path / "learned.yaml")},
    }

    def start(kind, forked=True, **given):
        parameters = {"managed": True, **needed.get(kind, {}), **given}
        return nodes.start(node_command(kind, parameters, {}, ros_env), kind, forked=forked)

    return start


@pytest.mark.parametrize(
    "kind", [pytest.param(each, marks=[needs_nav2] * (each == "nav2_bridge")) for each in MANAGED]
)
def test_a_managed_node_goes_through_its_states_and_has_its_topics_while_active(
    kind, start, nodes, probe
):
    process, manager = start(kind, forked=False), LifecycleManager(probe, kind)

    def topics():
        found = probe.node.get_publisher_names_and_types_by_node(kind, "/")
        described = {f"/{each}" for each in load_graph().nodes[kind].publishes}
        return described & {name for name, _ in found} - {"/diagnostics"}

    def subscribes():
        found = probe.node.get_subscriber_names_and_types_by_node(kind, "/")
        described = {f"/{each}" for each in load_graph().nodes[kind].subscribes}
        return described & {name for name, _ in found}

    # Its services may be known before the node is.
    probe.spin_until(lambda: kind in probe.node.get_node_names())
    assert manager.state == "unconfigured"
    assert {"unconfigured", "inactive", "active", "finalized"} <= manager.states
    assert {label for label, _, _ in manager.transitions()} == {"configure", "shutdown"}
    assert ("activate", "inactive", "activating") in manager.transitions("get_transition_graph")
    for _ in range(2):
        assert not subscribes()
        manager.go(*UP)
        probe.spin_until(subscribes)
        manager.go(*DOWN)
        probe.spin_until(lambda: not (topics() or subscribes()))
    assert not manager.change("activate")
    assert manager.state == "unconfigured"
    manager.go(*UP, ("deactivate", "inactive"), ("activate", "active"))
    probe.spin_until(subscribes)
    visited = [label for label in manager.events if label in ("inactive", "active", "unconfigured")]
    assert visited == [*["inactive", "active", "inactive", "unconfigured"] * 2,
                       "inactive", "active", "inactive", "active"]  # fmt: skip
    process.send_signal(signal.SIGINT)
    assert process.wait() == 0, nodes.log_of(kind)
    assert "internal error" not in nodes.log_of(kind)


@pytest.mark.parametrize(
    "transitions",
    [
        (),
        UP[:1],
        (("shutdown", "finalized"),),
        (*UP[:1], ("shutdown", "finalized")),
        (*UP, ("shutdown", "finalized")),
    ],
    ids=lambda transitions: "-".join(name for name, _ in transitions) or "unconfigured",
)
@pytest.mark.parametrize("kind", ["demo_recorder", "strategy"])
def test_a_signal_ends_a_managed_node_in_every_state(kind, transitions, start, nodes, probe):
    process, manager = start(kind), LifecycleManager(probe, kind)
    assert manager.state == "unconfigured"
    manager.go(*transitions)
    process.send_signal(signal.SIGINT)
    assert process.wait() == 0
    assert "rror" not in nodes.log_of(kind)


def test_a_model_that_is_missing_refuses_to_configure_until_another_one_is_set(
    start, nodes, probe, tmp_path, save_model_of
):
    model = save_model_of()
    process = start("strategy", model=str(tmp_path / "absent.yaml"))
    manager, reported = LifecycleManager(probe, "strategy"), []
    probe.node.create_subscription(
        DiagnosticArray,
        "diagnostics",
        lambda message: reported.extend(
            each.message for each in message.status if each.name == "strategy: lifecycle"
        ),
        qos.STATE,
    )

    def is_refused_by_name():
        assert not manager.change("configure")
        assert manager.state == "unconfigured"
        return any("absent.yaml" in each for each in reported)

    probe.spin_until(is_refused_by_name)
    assert "configure refused: " in nodes.log_of("strategy")
    assert process.poll() is None

    assert "timeout_s" in manager.set("timeout_s", -1.0)
    assert "managed is fixed" in manager.set("managed", False)
    assert manager.set("model", str(model)) == ""
    manager.go(*UP[:1])
    assert "cannot be set while the node is inactive" in manager.set("model", str(model))
    manager.go(*UP[1:])
    assert "seed is fixed" in manager.set("seed", 7)
    assert manager.set("goal", "3.5, 3.5") == ""
    manager.go(*DOWN, *UP)
    assert "internal error" not in nodes.log_of("strategy")


def test_each_activation_of_the_recorder_has_a_bag_of_what_came_while_it_was_active(
    start, probe, tmp_path
):
    start("demo_recorder", topics=["robot_pose"], minimum_free_mb=0.0)
    manager = LifecycleManager(probe, "demo_recorder")
    poses = probe.node.create_publisher(PoseStamped, "robot_pose", qos.STATE)
    sent = []

    def publish():
        sent.append(float(len(sent) + 1))
        poses.publish(to_pose_stamped((sent[-1], 0.0, 0.0), sent[-1]))

    manager.go(*UP[:1])
    publish()
    for bag in ("bag", "bag-2"):
        manager.go(("activate", "active"))
        probe.spin_until(poses.get_subscription_count)
        publish()
        probe.spin_until(lambda: poses.wait_for_all_acked())
        manager.go(("deactivate", "inactive"))
        (message,) = BagReader(tmp_path / bag).messages()
        assert message.topic == "/robot_pose"
        probe.spin_until(lambda: not poses.get_subscription_count())
        publish()
    manager.go(("cleanup", "unconfigured"), *UP)
    assert (tmp_path / "bag-3").is_dir()


@needs_nav2
def test_the_bridge_may_be_cleaned_up_while_nav2_answers(nodes, probe, start, start_robot):
    """An action client that is destroyed while an answer waits ends the process."""
    goals = []
    start_robot("--follow", "nav2")
    bridge = start("nav2_bridge")
    manager = LifecycleManager(probe, "nav2_bridge")
    waypoints = probe.node.create_publisher(PoseStamped, "waypoint", qos.COMMAND)
    probe.node.create_subscription(
        DiagnosticArray,
        "diagnostics",
        lambda message: goals.append(values_of(message, "nav2_bridge") or {}),
        qos.STATE,
    )

    def drives():
        waypoints.publish(to_pose_stamped((30.0, 3.5, 0.0), 0.0))
        return any(each.get("goal") == "driving" for each in goals)

    for _ in range(20):
        manager.go(*UP)
        goals.clear()
        probe.spin_until(drives)
        manager.go(*DOWN)
    assert bridge.poll() is None, nodes.log_of("nav2_bridge")


class Drives(Goals):
    """Goals, and the speeds of the robot."""

    def __init__(self, probe):
        super().__init__(probe)
        self.speeds_mps = []
        probe.node.create_subscription(Odometry, "odom", self._take_odometry, qos.SENSOR)

    def _take_odometry(self, message):
        self.speeds_mps.append(message.twist.twist.linear.x)

    def stands(self):
        """Whether the last five speeds are 0."""
        return not any(self.speeds_mps[-5:])


@pytest.mark.parametrize("stack", ["robot", pytest.param("robot_nav2", marks=needs_nav2)])
def test_a_managed_stack_drives_while_it_is_active(stack, nodes, probe, start_robot, save_model_of):
    drives, follows = Drives(probe), "nav2" if stack == "robot_nav2" else "cmd_vel"
    start_robot("--follow", follows)
    nodes.start_stack(stack, managed=True, model=str(save_model_of()))
    driving = "nav2_bridge" if stack == "robot_nav2" else "local_planner"
    managers = [LifecycleManager(probe, name) for name in (driving, "strategy")]

    def logs():
        return "\n".join(nodes.log_of(name) for name in ("strategy", driving, "standin_robot"))

    for manager in managers:
        manager.go(*UP)
    drives.drive_to((3.5, 3.5), logs)

    drives.send((3.5, 1.5))
    probe.spin_until(lambda: drives.n_begun == 2 and drives.speeds_mps[-1] > 0.1, seen=logs)
    for manager in reversed(managers):
        manager.go(*DOWN)
    probe.spin_until(lambda: drives.ends == ["arrived", "discarded"], seen=logs)
    probe.spin_until(drives.stands, seen=logs)

    for manager in managers:
        manager.go(*UP)
    drives.drive_to((3.5, 1.5), logs)
    assert drives.ends == ["arrived", "discarded", "arrived"]
    assert "internal error" not in logs()
