"""The node graph as data, read from graph.yaml: which node has which endpoints, which run together.

The launcher, the ROS launch file and the pictures use it. rclpy is imported where the parameters of
a node are looked up, with the module of that node.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import Field, model_validator

from serd_bag.nearest import hint
from serd_files.moved_names import where_or_near
from serd_files.yaml_config import StrictModel, load_yaml_model
from serd_ros.endpoints import topics
from serd_ros.errors import NodeError
from serd_ros.settings import NodeConfig

if TYPE_CHECKING:
    from rclpy.node import Node

GRAPH_YAML = Path(__file__).with_name("graph.yaml")
PACKAGE = "serd_ros"
#: Makes nodes meet on this machine alone, where the variable names it.
PROFILE_VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
LOOPBACK_PROFILE = Path(__file__).resolve().parents[1] / "process" / "fastdds_loopback.xml"
_NAMESPACE = re.compile(r"(/[A-Za-z_]\w*)+", re.ASCII)
Parameters = dict[str, Any]


class NodeEndpoints(StrictModel):
    """Names of the topics and services of one node.

    node: its module in serd_ros.nodes and its class, as guard:GuardNode. may_subscribe: topics it
    subscribes to depending on a parameter; no node waits for them.
    """

    node: str
    publishes: tuple[str, ...] = ()
    subscribes: tuple[str, ...] = ()
    may_subscribe: tuple[str, ...] = ()
    serves: tuple[str, ...] = ()
    calls: tuple[str, ...] = ()


class Stack(StrictModel):
    """Nodes that run together; `shared` goes to every node that has the parameter.

    parameters: of one node each; only `node.parameter` changes them, so that a name which means
    something else in another node (a bag played, a bag learned from) reaches the right one.
    remappings: for each node its topics that have another name in this stack.
    """

    about: str
    nodes: tuple[str, ...]
    shared: dict[str, Any] = Field(default_factory=dict)
    parameters: dict[str, dict[str, Any]] = Field(default_factory=dict)
    remappings: dict[str, dict[str, str]] = Field(default_factory=dict)


class Graph(StrictModel):
    """All nodes and all stacks."""

    nodes: dict[str, NodeEndpoints]
    stacks: dict[str, Stack]

    @model_validator(mode="after")
    def _names_are_known(self) -> "Graph":
        for name, stack in self.stacks.items():
            for node in (*stack.nodes, *stack.parameters, *stack.remappings):
                if node not in self.nodes:
                    raise ValueError(f"stack {name} names node {node!r}; {hint(node, self.nodes)}")
        return self

    def has_world(self, stack: Stack) -> bool:
        """Whether a node of the stack publishes the clock, as a simulator and a replay do."""
        return any("/clock" in self.nodes[node].publishes for node in stack.nodes)

    def namespace_remappings(self, stack: Stack, namespace: str) -> dict[str, str]:
        """The clock of a world, which has a namespace in no name of its own; namespace: in full."""
        return {"/clock": f"{namespace}/clock"} if namespace and self.has_world(stack) else {}


def full_namespace(name: str) -> str:
    """The namespace with a slash before it, empty for none; NodeError for a name that is none."""
    if not name.strip("/"):
        return ""
    full = f"/{name.strip('/')}"
    if not _NAMESPACE.fullmatch(full):
        raise NodeError(
            "namespace must be letters, digits, _ and /, no part of it beginning with a digit,"
            f" got {name!r}; write it as robot1"
        )
    return full


@cache
def load_graph() -> Graph:
    """The graph of this package."""
    return load_yaml_model(GRAPH_YAML, Graph)


def module_of(kind: str) -> str:
    """The name of the module of a node."""
    return f"serd_ros.nodes.{load_graph().nodes[kind].node.partition(':')[0]}"


def class_of(kind: str) -> Any:
    """The class of a node; imports its module."""
    name = load_graph().nodes[kind].node.partition(":")[2]
    return getattr(import_module(module_of(kind)), name)


def config_of(kind: str) -> type[NodeConfig]:
    """The parameters of a node; imports its module."""
    config: type[NodeConfig] = class_of(kind).config_class
    return config


def find_stack(name: str) -> Stack:
    """The stack of that name; NodeError with the nearest right one."""
    stacks = load_graph().stacks
    if name not in stacks:
        raise NodeError(f"there is no stack {name!r}; {hint(name, stacks)}")
    return stacks[name]


def stack_parameters(stack: Stack, given: Mapping[str, Any]) -> dict[str, Parameters]:
    """Parameters of each node of the stack: `shared`, the stack's own, then what was given.

    given: keys are a parameter's name, for every node that has it and to which the stack gives no
    value of its own, or `node.parameter`. Raises NodeError for a name that reaches no node.
    """
    layers: dict[str, Parameters] = {}
    for node in stack.nodes:
        fields = config_of(node).model_fields
        shared = {name: value for name, value in stack.shared.items() if name in fields}
        layers[node] = shared | stack.parameters.get(node, {})
    for key, value in given.items():
        for node, name in addressees(stack, key):
            layers[node][name] = value
    return layers


@dataclass(frozen=True)
class PlacedNode:
    """A node of a stack with its parameters; namespace: in full, empty for none."""

    node: str
    parameters: Parameters
    namespace: str
    remappings: Mapping[str, str]


def placed_nodes(stack: Stack, given: Mapping[str, Any], namespace: str = "") -> list[PlacedNode]:
    """All nodes of a stack. given: as `stack_parameters` takes it; namespace: in full."""
    shared = load_graph().namespace_remappings(stack, namespace)
    return [
        PlacedNode(node, parameters, namespace, shared | stack.remappings.get(node, {}))
        for node, parameters in stack_parameters(stack, given).items()
    ]


def addressees(stack: Stack, key: str) -> list[tuple[str, str]]:
    """(node, parameter) that `parameter` or `node.parameter` sets; NodeError where it is none."""
    node, dot, name = key.rpartition(".")
    if dot:
        if node not in stack.nodes:
            raise NodeError(f"{key!r} names no node of this stack; {hint(node, stack.nodes)}")
        if name not in config_of(node).model_fields:
            near = where_or_near("parameter", name, config_of(node).model_fields)
            raise NodeError(f"{node} has no parameter {name!r}; {near}")
        return [(node, name)]
    having = [each for each in stack.nodes if key in config_of(each).model_fields]
    if not having:
        everything = {known for each in stack.nodes for known in config_of(each).model_fields}
        near = where_or_near("parameter", key, everything)
        raise NodeError(f"no node of this stack has a parameter {key!r}; {near}")
    found = [(each, key) for each in having if key not in stack.parameters.get(each, {})]
    if not found:
        names = " or ".join(f"{each}.{key}" for each in having)
        raise NodeError(f"the stack itself sets {key!r} for each node; name the node: {names}")
    return found


PATIENCE_S = 10.0
WORLD_TOPICS = (topics.CLOCK, topics.ROBOT_POSE)
_FIX = (
    "end the other stack, or start one with another ROS_DOMAIN_ID, or by serd launch with a"
    " namespace"
)


def publishers_of(node: "Node", topic: str) -> list[str]:
    """Full names of the nodes that publish a topic, one for each publisher."""
    found = node.get_publishers_info_by_topic(topic)
    return sorted(f"{each.node_namespace.rstrip('/')}/{each.node_name}" for each in found)


def several_worlds(node: "Node", world_topics: Sequence[str] = WORLD_TOPICS) -> str:
    """What must be, what is and the fix, where several publish a world; empty where none do."""
    for topic in world_topics:
        names = publishers_of(node, topic)
        if len(names) > 1:
            name = node.resolve_topic_name(topic)
            return f"one publisher of {name}, got {len(names)}: {', '.join(names)}; {_FIX}"
    return ""


class Readiness:
    """Looks at one node's publishers; `required_nodes` must be present in its namespace."""

    def __init__(self, node: "Node", required_nodes: Sequence[str], now_s: float) -> None:
        # A ROS parameter cannot be an empty list, so none is written [""].
        self._required = tuple(name for name in required_nodes if name)
        self._node, self._since_s = node, now_s
        self._seen: tuple[int, ...] = ()
        self._was_ready = False

    def was_ready(self, now_s: float) -> bool:
        """Whether nothing is missing, or was before; the graph is looked at until then."""
        self._was_ready = self._was_ready or not self.missing(now_s)
        return self._was_ready

    def missing(self, now_s: float) -> str:
        """What is missing, as words; empty when ready. now_s: steady wall time."""
        here = self._node.get_namespace()
        present = self._node.get_node_names_and_namespaces()
        absent = [name for name in self._required if (name, here) not in present]
        publishers = list(self._node.publishers)
        known = [int(self._node.count_subscribers(each.topic_name)) for each in publishers]
        seen = len(absent), *known
        if seen != self._seen:
            self._seen, self._since_s = seen, now_s
        if absent:
            return f"node {', '.join(absent)}"
        if now_s - self._since_s < PATIENCE_S:
            described = [self._described(each.topic_name) for each in publishers]
            known = list(map(max, known, described))
        short = [
            publisher.topic_name
            for publisher, needed in zip(publishers, known, strict=True)
            if publisher.get_subscription_count() < needed
        ]
        return f"subscribers of {', '.join(short)}" if short else ""

    def _described(self, topic_name: str) -> int:
        nodes = load_graph().nodes
        return sum(
            topic_name == self._node.resolve_topic_name(topic)
            for name in self._required
            if name in nodes
            for topic in nodes[name].subscribes
        )
