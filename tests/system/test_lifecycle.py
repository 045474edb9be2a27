"""Managed nodes go through their states by the services that a lifecycle manager calls."""

import importlib.util
import signal
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from nav_msgs.msg import Odometry

from serd_cli.processes.workspace import node_command
from serd_ros.convert.diagnostics import values_of
from serd_ros.convert.motion import to_pose_stamped
from serd_ros.endpoints import qos
from serd_ros.graph.graph import config_of, load_graph
from serd_ros.settings import ManagedConfig
from support.goals import Goals

pytestmark = [pytest.mark.ros, pytest.mark.slow]
has_nav2 = importlib.util.find_spec("nav2_msgs") is not None
needs_nav2 = pytest.mark.skipif(
    not has_nav2, reason="nav2_msgs is not installed; run make interfaces"
)
MANAGED = sorted(
    kind
    for kind in load_graph().nodes
    if issubclass(config_of(kind), ManagedConfig) and (kind != "nav2_bridge" or has_nav2)
)
UP = (("configure", "inactive"), ("activate", "active"))
DOWN = (("deactivate", "inactive"), ("cleanup", "unconfigured"))
SERVICES = {"change_state": ChangeState, "get_state": GetState}


class LifecycleManager:
    """Of one node; probe: a node of the test's own that can spin."""

    def __init__(self, probe, node):
        self._probe, self._name = probe, f"/{node}"
        create = probe.node.create_client
        self._clients = {name: create(kind, f"/{node}/{name}") for name, kind in SERVICES.items()}
        # A server's response is lost where it knows a client's request, but not its reader yet
        # (ros2/rmw_fastrtps #842). The last client made here is the last to become known.
        client, answers = self._clients["get_state"], []
        probe.spin_until(client.service_is_ready, seen=lambda: node)

        def is_answered():
            if time.monotonic() > 2.0 * len(answers) + began_s:
                answers.append(client.call_async(GetState.Request()))
            return any(each.done() for each in answers)

        began_s = time.monotonic()
        probe.spin_until(is_answered, seen=lambda: node)

    def call(self, service, **fields):
        """The response of one of the node's services."""
        client = self._clients[service]
        self._probe.spin_until(client.service_is_ready, seen=lambda: client.srv_name)
        future = client.call_async(SERVICES[service].Request(**fields))
        self._probe.spin_until(future.done, seen=lambda: client.srv_name)
        return future.result()

    def change(self, transition):
        """Whether the transition of this name succeeded."""
        return self.call("change_state", transition=Transition(label=transition)).success

    def go(self, *transitions):
        """Make (transition, state after it) one after the other."""
        for transition, state in transitions:
            assert self.change(transition), (self._name, transition)
            assert self.state == state

    @property
    def state(self):
        return self.call("get_state").current_state.label

    def topics(self, kind, described, named_by):
        """Those of the graph that the node has now."""
        names = {name for name, _ in named_by(kind, "/")}
        return {f"/{each}" for each in described} & names - {"/diagnostics"}

    @property
    def published(self):
        kind, node = self._name[1:], self._probe.node
        described = load_graph().nodes[kind].publishes
        return self.topics(kind, described, node.get_publisher_names_and_types_by_node)

    @property
    def subscribed(self):
        kind, node = self._name[1:], self._probe.node
        described = load_graph().nodes[kind].subscribes
        return self.topics(kind, described, node.get_subscriber_names_and_types_by_node)


@pytest.fixture
def start(nodes, ros_env, tmp_path, save_model_of):
    """Starts a managed node with the parameters that it needs."""
    needed = {
        "strategy": {"model": str(save_model_of())},
        "demo_recorder": {"output": str(tmp_path / "bag")},
        "learner": {"output": str(tmp_path / "learned.yaml")},
    }

    def start(kind):
        parameters = {"managed": True, **needed.get(kind, {})}
        return nodes.start(node_command(kind, parameters, {}, ros_env), kind)

    return start


def test_managed_nodes_go_through_their_states_and_have_their_topics_while_active(
    start, nodes, probe
):
    """All of them in one domain."""
    processes = {kind: start(kind) for kind in MANAGED}
    managers = {kind: LifecycleManager(probe, kind) for kind in MANAGED}
    # Its services may be known before the node is.
    probe.spin_until(lambda: set(MANAGED) <= set(probe.node.get_node_names()))
    for manager in managers.values():
        assert manager.state == "unconfigured"
        assert not manager.subscribed
        manager.go(*UP)
        probe.spin_until(lambda manager=manager: manager.subscribed)
        manager.go(*DOWN)
        probe.spin_until(lambda manager=manager: not (manager.published or manager.subscribed))
        assert not manager.change("activate")
        manager.go(*UP, ("deactivate", "inactive"), ("activate", "active"))
        probe.spin_until(lambda manager=manager: manager.subscribed)
    for process in processes.values():
        process.send_signal(signal.SIGINT)
    for kind, process in processes.items():
        assert process.wait() == 0, nodes.log_of(kind)
        assert "internal error" not in nodes.log_of(kind)


STATES = {
    "unconfigured": (),
    "inactive": UP[:1],
    "finalized": (("shutdown", "finalized"),),
    "finalized_active": (*UP, ("shutdown", "finalized")),
}


def test_a_signal_ends_a_managed_node_in_every_state(nodes, probe, ros_env, tmp_path):
    processes = {}
    for name, transitions in STATES.items():
        given = {"managed": True, "output": str(tmp_path / name)}
        command = node_command("demo_recorder", given, {"__node": name}, ros_env)
        processes[name] = nodes.start(command, name)
        LifecycleManager(probe, name).go(*transitions)
    for name, process in processes.items():
        process.send_signal(signal.SIGINT)
        assert process.wait() == 0
        assert "rror" not in nodes.log_of(name)


@needs_nav2
def test_the_bridge_may_be_cleaned_up_while_nav2_answers(nodes, probe, start, start_robot):
    """An action client that is destroyed while an answer waits ends the process."""
    goals = []
    start_robot("--follow", "nav2")
    bridge, manager = start("nav2_bridge"), LifecycleManager(probe, "nav2_bridge")
    waypoints = probe.node.create_publisher(PoseStamped, "waypoint", qos.COMMAND)
    take = lambda message: goals.append(values_of(message, "nav2_bridge") or {})  # noqa: E731
    probe.node.create_subscription(DiagnosticArray, "diagnostics", take, qos.STATE)

    def drives():
        waypoints.publish(to_pose_stamped((30.0, 3.5, 0.0), 0.0))
        return any(each.get("goal") == "driving" for each in goals)

    for _ in range(5):
        manager.go(*UP)
        goals.clear()
        probe.spin_until(drives)
        manager.go(*DOWN)
    assert bridge.poll() is None, nodes.log_of("nav2_bridge")


def test_a_managed_stack_drives_while_it_is_active(nodes, probe, start_robot, save_model_of):
    goals, speeds_mps = Goals(probe), []
    take = lambda message: speeds_mps.append(message.twist.twist.linear.x)  # noqa: E731
    probe.node.create_subscription(Odometry, "odom", take, qos.SENSOR)
    start_robot()
    nodes.start_stack("robot", managed=True, model=str(save_model_of()))
    managers = [LifecycleManager(probe, name) for name in ("local_planner", "strategy")]

    def logs():
        return "\n".join(map(nodes.log_of, ("strategy", "local_planner", "standin_robot")))

    for manager in managers:
        manager.go(*UP)
    goals.drive_to((3.5, 3.5), logs)

    goals.send((3.5, 1.5))
    probe.spin_until(lambda: goals.n_begun == 2 and speeds_mps[-1] > 0.1, seen=logs)
    for manager in reversed(managers):
        manager.go(*DOWN)
    probe.spin_until(lambda: goals.ends == ["arrived", "discarded"], seen=logs)
    probe.spin_until(lambda: not any(speeds_mps[-5:]), seen=logs)

    for manager in managers:
        manager.go(*UP)
    goals.drive_to((3.5, 1.5), logs)
    assert goals.ends == ["arrived", "discarded", "arrived"]
    assert "internal error" not in logs()
