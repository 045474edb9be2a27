"""Managed nodes go through their states by the services that a lifecycle manager calls."""

import importlib.util
import math
import signal
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.msg import Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from nav_msgs.msg import Odometry

from serd_cli.processes.node_commands import node_command
from serd_ros.convert.diagnostics import values_of
from serd_ros.convert.pose import to_pose_stamped
from serd_ros.endpoints import qos
from serd_ros.graph.graph import config_of, load_graph
from serd_ros.settings import ManagedConfig
from support.goals import Goals

pytestmark = [pytest.mark.ros, pytest.mark.slow]
MANAGED = sorted(kind for kind in load_graph().nodes if issubclass(config_of(kind), ManagedConfig))
needs_nav2 = pytest.mark.skipif(
    importlib.util.find_spec("nav2_msgs") is None,
    reason="nav2_msgs is not installed; run make interfaces",
)


UP = (("configure", "inactive"), ("activate", "active"))
DOWN = (("deactivate", "inactive"), ("cleanup", "unconfigured"))
_SERVICES = {
    "change_state": ChangeState,
    "get_available_states": GetAvailableStates,
    "get_available_transitions": GetAvailableTransitions,
    "get_transition_graph": GetAvailableTransitions,
    "get_state": GetState,
}
_ASK_AGAIN_S = 2.0


class LifecycleManager:
    """Of one node; probe: a node of the test's own that can spin. events: labels of states."""

    def __init__(self, probe, node):
        self._probe, self.events = probe, []
        probe.node.create_subscription(
            TransitionEvent,
            f"/{node}/transition_event",
            lambda event: self.events.append(event.goal_state.label),
            10,
        )
        create = probe.node.create_client
        self._clients = {name: create(kind, f"/{node}/{name}") for name, kind in _SERVICES.items()}
        self._become_known()

    def _become_known(self):
        """Ask for the state until there is an answer.

        A server's response is lost where it knows a client's request, but not its reader yet
        (ros2/rmw_fastrtps #842). The last client made here is the last to become known.
        """
        client, asked_s, answers = self._clients["get_state"], -math.inf, []

        def is_answered():
            nonlocal asked_s
            if time.monotonic() - asked_s > _ASK_AGAIN_S:
                asked_s = time.monotonic()
                answers.append(client.call_async(GetState.Request()))
            return any(each.done() for each in answers)

        self._probe.spin_until(client.service_is_ready, seen=lambda: client.srv_name)
        self._probe.spin_until(is_answered, seen=lambda: client.srv_name)

    def call(self, service, **fields):
        """The response of one of the node's services."""
        client = self._clients[service]
        self._probe.spin_until(client.service_is_ready, seen=lambda: client.srv_name)
        future = client.call_async(_SERVICES[service].Request(**fields))
        self._probe.spin_until(future.done, seen=lambda: client.srv_name)
        return future.result()

    def change(self, transition):
        """Whether the transition of this name succeeded."""
        wanted = Transition(label=transition)
        return self.call("change_state", transition=wanted).success

    def go(self, *transitions):
        """Make (transition, state after it) one after the other."""
        for transition, state in transitions:
            assert self.change(transition), transition
            assert self.state == state

    @property
    def state(self):
        """Label of the present state."""
        return self.call("get_state").current_state.label

    @property
    def states(self):
        """Labels of all states."""
        found = self.call("get_available_states").available_states
        return {each.label for each in found}

    def transitions(self, service="get_available_transitions"):
        """(label, state before, state after) of the possible ones, or of the whole graph."""
        found = self.call(service).available_transitions
        return {
            (each.transition.label, each.start_state.label, each.goal_state.label) for each in found
        }


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
