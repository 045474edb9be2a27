"""The graph description: known names only, parameters to the nodes that have them."""

from pathlib import Path
from typing import Generic

import pytest
from rclpy.node import Node

from serd_ros.errors import NodeError
from serd_ros.graph.graph import (
    PACKAGE,
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
from serd_ros.nodes.watch_page import WatchView
from serd_ros.process.serd_node import SerdNode

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
    assert set(WatchView.topics) - {"diagnostics"} <= set(recorded)
    assert set(recorded) == set(load_graph().nodes["demo_recorder"].subscribes)


@pytest.mark.parametrize(
    ("stack", "given", "expected"),
    [
        ("demonstrate", {"seed": 5}, {"hallway_sim.seed": 5, "scripted_expert.seed": 5}),
        ("live", {"local_planner.scenario": "corridor"},
         {"local_planner.scenario": "corridor", "hallway_sim.scenario": "hallway"}),
        # A name does not reach a node to which the stack gives its own value.
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


def test_no_name_means_different_things_in_the_nodes_it_reaches():
    for name, stack in load_graph().stacks.items():
        for own in {"bag", "output"}:
            reached = [
                node
                for node in stack.nodes
                if own in config_of(node).model_fields and own not in stack.parameters.get(node, {})
            ]
            assert len(reached) <= 1, (name, own, reached)


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
