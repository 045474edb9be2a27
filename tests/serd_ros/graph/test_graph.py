"""The graph description: known names only, parameters to the nodes that have them."""

import json
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Generic

import pytest
import yaml
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy

from serd_files.settings import settings_of
from serd_files.yaml_config import model_yaml
from serd_ros.endpoints.topic_types import topic_type
from serd_ros.errors import NodeError
from serd_ros.graph.graph import (
    PACKAGE,
    PATIENCE_S,
    Readiness,
    class_of,
    config_of,
    find_stack,
    full_namespace,
    load_graph,
    module_of,
    placed_nodes,
    stack_parameters,
)
from serd_ros.nodes.demo_recorder import DemoRecorderConfig
from serd_ros.nodes.guard import GuardConfig
from serd_ros.nodes.hallway_sim import HallwaySimConfig
from serd_ros.nodes.local_planner import LocalPlannerConfig
from serd_ros.nodes.watch_page import WatchView
from serd_ros.process.serd_node import SerdNode, validated
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.scenario import load_scenario
from support.nodes_in_process import needed_parameters, node_in_process

SIMULATORS = {"hallway_sim", "bag_replay"}
FROM_PEOPLE = {"goal_pose"}
ROOT = Path(__file__).resolve().parents[3]


def _path_of(node):
    return ROOT / f"{module_of(node).replace('.', '/')}.py"


def test_every_module_of_the_nodes_is_in_the_graph():
    paths = (ROOT / PACKAGE / "nodes").rglob("*.py")
    modules = {path for path in paths if path.stem != "__init__"}
    assert modules == set(map(_path_of, load_graph().nodes))


def test_the_classes_of_a_node_above_rclpys_override_nothing_of_it():
    public = {name for name in dir(Node) if not name.startswith("_")}
    for kind in load_graph().nodes:
        ours = class_of(kind).mro()
        ours = [each for each in ours[: ours.index(Node)] if each is not Generic]
        assert ours[1:] == [SerdNode]
        assert not public & {name for each in ours for name in vars(each)}


def test_every_subscribed_topic_is_published_by_some_node():
    graph = load_graph()
    published = {topic for node in graph.nodes.values() for topic in node.publishes}
    for stack in graph.stacks.values():
        published |= {topic for names in stack.remappings.values() for topic in names.values()}
    subscribed = {topic for node in graph.nodes.values() for topic in node.subscribes}
    assert subscribed <= published | FROM_PEOPLE
    served = {name for node in graph.nodes.values() for name in node.serves}
    assert {name for node in graph.nodes.values() for name in node.calls} <= served


def test_all_that_the_page_shows_is_recorded_but_for_diagnostics():
    recorded = DemoRecorderConfig().topics
    assert set(WatchView.topics) - {"diagnostics", "guard_state"} <= set(recorded)
    assert set(recorded) == set(load_graph().nodes["demo_recorder"].subscribes)


@pytest.mark.parametrize(
    ("stack", "given", "expected"),
    [
        ("demonstrate", {"seed": 5}, {"hallway_sim.seed": 5, "scripted_expert.seed": 5}),
        ("live", {"local_planner.scenario": "corridor"},
         {"local_planner.scenario": "corridor", "hallway_sim.scenario": "hallway"}),
        # A name does not reach a node to which the stack gives its own value.
        ("replay_and_learn", {"bag": "drive"}, {"bag_replay.bag": "drive", "learner.bag": ""}),
        ("demonstrate_and_learn", {"output": "drive"},
         {"demo_recorder.output": "drive", "learner.output": "model.yaml",
          "scripted_expert.output": ""}),
    ],
)  # fmt: skip
def test_a_parameter_reaches_the_nodes_that_it_means(stack, given, expected):
    layers = stack_parameters(find_stack(stack), given)
    for name, value in expected.items():
        node, _, parameter = name.partition(".")
        assert layers[node][parameter] == value, name
    assert "seed" not in layers.get("local_planner", {})


@pytest.mark.parametrize(
    ("stack", "name", "sentence"),
    [
        ("live", "sede", "no node of this stack has a parameter 'sede'; did you mean 'seed'"),
        ("live", "hallway_sm.seed", "names no node of this stack; did you mean 'hallway_sim'"),
        ("live", "hallway_sim.sede", "hallway_sim has no parameter 'sede'; did you mean 'seed'"),
        ("demonstrate", "required_nodes",
         "name the node: hallway_sim.required_nodes or local_planner.required_nodes"),
    ],
)  # fmt: skip
def test_a_wrong_or_missing_name_gets_the_right_one(stack, name, sentence):
    with pytest.raises(NodeError, match=sentence):
        stack_parameters(find_stack(stack), {name: 1})


def test_in_a_namespace_a_world_has_a_clock_of_its_own_and_a_robot_that_of_the_domain():
    graph = load_graph()
    for name, stack in graph.stacks.items():
        own = {"/clock": "/robot1/clock"} if SIMULATORS & set(stack.nodes) else {}
        assert graph.namespace_remappings(stack, "/robot1") == own, name
        assert graph.namespace_remappings(stack, "") == {}
    placed = placed_nodes(find_stack("demonstrate"), {"seed": 4}, "/robot1")
    nodes = {each.node: each for each in placed}
    assert list(nodes) == list(find_stack("demonstrate").nodes)
    assert {each.namespace for each in placed} == {"/robot1"}
    assert nodes["guard"].remappings == {"/clock": "/robot1/clock"}
    assert nodes["hallway_sim"].parameters["seed"] == 4


@pytest.mark.parametrize("name", ["1robot", "robot-1", "a//b", "robot 1", "a/2"])
def test_a_name_that_is_no_namespace_is_refused(name):
    with pytest.raises(NodeError, match="namespace must be letters"):
        full_namespace(name)


RVIZ_TYPES = {
    "LaserScan": "sensor_msgs/msg/LaserScan",
    "Map": "nav_msgs/msg/OccupancyGrid",
    "MarkerArray": "visualization_msgs/msg/MarkerArray",
    "Path": "nav_msgs/msg/Path",
    "PointCloud2": "sensor_msgs/msg/PointCloud2",
    "Polygon": "geometry_msgs/msg/PolygonStamped",
    "Pose": "geometry_msgs/msg/PoseStamped",
    "SetGoal": "geometry_msgs/msg/PoseStamped",
}
#: A pose that is sent and not shown.
SENT = "goal_pose"
#: Its type, a String, has no display by itself.
DESCRIPTION = "robot_description"


def type_of(topic):
    return topic_type(topic, stamped_cmd_vel=False)


@pytest.fixture(scope="module")
def shown():
    """Published topics of the types that have a display, and the String that has one of its own."""
    published = {topic for node in load_graph().nodes.values() for topic in node.publishes}
    return {t for t in published if type_of(t).name in RVIZ_TYPES.values()} | {DESCRIPTION}


def test_rviz_shows_each_topic_by_the_display_of_its_type(root, shown):
    text = (root / "ros_ws/src/serd_bringup/rviz/serd.rviz").read_text()
    manager, found = yaml.safe_load(text)["Visualization Manager"], []
    for each in (*manager["Displays"], *manager["Tools"]):
        shown_by = each["Class"].partition("/")[2]
        place = each.get("Description Topic" if shown_by == "RobotModel" else "Topic")
        if place is None:
            continue
        kind = type_of(place["Value"])
        assert kind.name == RVIZ_TYPES.get(shown_by, "std_msgs/msg/String")
        if place.get("Durability Policy") == "Transient Local":
            assert kind.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL, place
        found.append(place["Value"])
    assert sorted(found) == sorted(shown | {SENT})
    assert any(each["Class"] == "rviz_default_plugins/TF" for each in manager["Displays"])


def test_foxglove_shows_the_same_topics(root, shown):
    layout = json.loads((root / "ros_ws/src/serd_bringup/foxglove/serd.json").read_text())
    panels = layout["configById"]
    assert {topic.removeprefix("/") for topic in panels["3D!world"]["topics"]} == shown
    assert panels["3D!world"]["publish"]["poseTopic"] == f"/{SENT}"
    summary = panels["DiagnosticSummary!nodes"]["topicToRender"].removeprefix("/")
    assert type_of(summary).name == "diagnostic_msgs/msg/DiagnosticArray"


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"seed": -1}, "seed must be greater than or equal to 0, got -1"),
        ({"command_timeout_s": 0.8}, "command_timeout_s must be less than or equal to 0.5, got 0"),
        ({"lockstep": "yes"}, "lockstep must be a boolean, got 'yes'"),
        ({"lockstep_timeout_s": float("nan")}, "lockstep_timeout_s must be a finite number"),
    ],
)
def test_a_bad_value_names_the_parameter_the_rule_and_the_value(values, sentence):
    with pytest.raises(NodeError, match=f"parameter of hallway_sim: {sentence}"):
        validated("hallway_sim", values, HallwaySimConfig)


def config(scenario, **given):
    """The config of the node: its defaults, then the scenario's, then the values given."""
    return validated("local_planner", {"scenario": str(scenario), **given}, LocalPlannerConfig)


@pytest.mark.parametrize("name", builtin_scenarios())
def test_the_defaults_of_the_node_are_those_of_every_built_in_scenario(name):
    parameters = LocalPlannerConfig.defaults({"scenario": name})
    assert None not in parameters.values()
    assert parameters == LocalPlannerConfig.defaults({})


def test_what_is_given_wins_and_reaches_the_planner(tmp_path):
    """The robot of the corridor is slower than usual, and its planner is slower still."""
    slow = load_scenario("corridor").with_values("robot", max_vel_x_mps=0.9, acc_lim_x_mps2=2.0)
    slow = slow.with_values("local_planner", max_vel_x=0.7, sim_time=2.0)
    path = tmp_path / "slow.yaml"
    path.write_text(model_yaml(slow))
    scenario = config(path, max_vel_x=0.5, vx_samples=5).planned_scenario()
    limited = scenario.local_planner.limited(scenario.robot)
    assert (limited.max_vel_x_mps, limited.acc_lim_x_mps2) == (0.5, 2.0)
    assert (scenario.local_planner.vx_samples, scenario.local_planner.sim_time) == (5, 2)
    assert scenario.robot == slow.robot


def test_a_guard_of_a_robot_that_accelerates_less_does_not_count_on_harder_braking():
    def braking(**given):
        return validated("guard", {"scenario": "hallway", **given}, GuardConfig).guard().braking

    assert braking() == load_scenario("hallway").robot.decel_lim_x_mps2
    assert braking(acc_lim_x=1.0) == 1.0
    assert braking(acc_lim_x=1.0, decel_lim_x=3.0) == 3.0


@pytest.mark.parametrize(
    ("namespace", "missing"), [("/robot1", ""), ("/robot2", "node guard"), ("/", "node guard")]
)
def test_required_nodes_are_looked_for_in_the_own_namespace(namespace, missing):
    node = SimpleNamespace(
        get_namespace=lambda: namespace,
        get_node_names_and_namespaces=lambda: [("guard", "/robot1"), ("strategy", namespace)],
        publishers=[],
    )
    assert Readiness(node, ["guard", ""], 0.0).missing(0.0) == missing


def test_patience_begins_with_the_last_node_or_subscription_that_has_appeared():
    """A learner that starts late is present long before it subscribes."""
    present, count = [], [0]
    poses = SimpleNamespace(topic_name="/robot_pose", get_subscription_count=lambda: count[0])
    node = SimpleNamespace(
        get_namespace=lambda: "/",
        get_node_names_and_namespaces=lambda: present,
        count_subscribers=lambda _: count[0],
        resolve_topic_name=lambda name: f"/{name}",
        publishers=[poses],
    )
    readiness = Readiness(node, ["learner"], 0.0)
    assert readiness.missing(3.0 * PATIENCE_S) == "node learner"
    present.append(("learner", "/"))
    assert readiness.missing(4.0 * PATIENCE_S) == "subscribers of /robot_pose"
    assert readiness.missing(4.9 * PATIENCE_S) == "subscribers of /robot_pose"
    assert readiness.missing(5.0 * PATIENCE_S) == ""  # it is configured to subscribe to less
    count[0] = 1
    assert readiness.missing(5.1 * PATIENCE_S) == ""


UNITS = {"s": "s", "m": "m", "mps": "m/s", "mps2": "m/s2", "radps": "rad/s", "hz": "Hz", "mb": "MB"}
#: Numbers that are counts or shares.
WITHOUT_RANGE = {"sensor_x", "sensor_y", "sensor_yaw"}


@pytest.mark.usefixtures("nav2_server")
@pytest.mark.parametrize("kind", sorted(load_graph().nodes))
def test_every_parameter_is_described_and_refuses_to_be_set_unless_it_may_change(
    kind, tmp_path, save_model_of, small_bag
):
    given = needed_parameters(tmp_path, save_model_of()) | {"bag_replay": {"bag": str(small_bag())}}
    with node_in_process(kind, **given.get(kind, {})) as running:
        node, config = running.node, config_of(kind)
        plain = Node("plain")
        for name, value in vars(plain).items():  # a node of ours hides no attribute of rclpy's
            assert type(vars(node)[name]) is type(value), name
        plain.destroy_node()
        live = {each.name for each in settings_of(config) if each.live}
        for name in config.model_fields:
            described, parameter = node.describe_parameter(name), node.get_parameter(name)
            assert len(described.description) > 5, name
            assert described.type == parameter.type_.value, name
            result = running.set(**{name: parameter.value})
            assert result.successful == (name in live), name
            assert result.successful or f"{name} is fixed while {kind} runs" in result.reason
        running.assert_alive()


def test_every_number_has_its_unit_and_its_range():
    for kind in load_graph().nodes:
        for setting in settings_of(config_of(kind)):
            if setting.schema["type"] not in ("number", "integer"):
                continue
            assert setting.range or setting.name in WITHOUT_RANGE, setting.name
            suffix = re.search(r"_([a-z0-9]+)$", setting.name)
            if suffix and suffix[1] in UNITS:
                assert f"({UNITS[suffix[1]]})" in setting.description, setting.name


def test_a_node_lives_on_after_use_sim_time_was_set_and_unset():
    with node_in_process("guard") as running:
        for value in (True, False):
            assert running.set(use_sim_time=value).successful
            running.call_timers()
        running.assert_alive()


_NODES = (
    "hallway_sim", "guard", "local_planner", "scripted_expert", "demo_recorder", "teleop_mux",
)  # fmt: skip


def test_nodes_with_a_scenario_load_no_package_of_scipy():
    """A stack starts half a dozen of them at once."""
    program = (
        f"import sys, {', '.join(map(module_of, _NODES))}\n"
        "from serd_sim.scenario.scenario import load_scenario\n"
        'load_scenario("t_junction"); print(*sys.modules)'
    )
    command = [sys.executable, "-W", "error", "-c", program]
    loaded = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    packages = {"sparse", "ndimage", "spatial", "special", "linalg", "optimize"}
    assert not {f"scipy.{package}" for package in packages}.intersection(loaded)
