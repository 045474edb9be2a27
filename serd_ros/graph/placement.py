"""Which nodes of a stack run where: in one namespace, or for several robots in one world.

Robots that share a world have a namespace each, with all nodes of the stack but the simulator, and
frames with its name as prefix. The simulator runs once and has a node in each namespace.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from serd_ros.errors import NodeError
from serd_ros.graph.configs import CONFIGS
from serd_ros.graph.graph import (
    Parameters,
    Stack,
    addressees,
    full_namespace,
    load_graph,
    stack_parameters,
)

_WORLD = "hallway_sim"
#: Parameters that are paths to which robots would write together.
_PATHS = ("output", "decisions", "state")


@dataclass(frozen=True)
class PlacedNode:
    """A node of a stack. robot: the one that it works for, empty where there is one alone."""

    node: str
    parameters: Parameters
    namespace: str = ""
    remappings: Mapping[str, str] = field(default_factory=dict)
    robot: str = ""


def placed_nodes(
    stack: Stack, given: Mapping[str, Any], namespace: str = "", robots: Sequence[str] = ()
) -> list[PlacedNode]:
    """All nodes of a stack with their parameters.

    given: as `stack_parameters` takes it; with robots, `robot.name` and `robot.node.name` are for
    the nodes of one robot. namespace: in full. Paths to write, unless given for one robot, get its
    name as a folder.
    """
    if f"{_WORLD}.robots" in given:
        raise NodeError(
            f"the nodes of several robots are started by robots, got {_WORLD}.robots;"
            " write robots:=[robot1, robot2]"
        )
    if robots:
        return _nodes_of_robots(stack, given, namespace, robots)
    shared = load_graph().namespace_remappings(stack, namespace)
    return [
        PlacedNode(node, parameters, namespace, shared | stack.remappings.get(node, {}))
        for node, parameters in stack_parameters(stack, given).items()
    ]


def _nodes_of_robots(
    stack: Stack, given: Mapping[str, Any], namespace: str, robots: Sequence[str]
) -> list[PlacedNode]:
    if _WORLD not in stack.nodes:
        raise NodeError(f"robots need a stack with {_WORLD}, got {', '.join(stack.nodes)}")
    if namespace or "frame_prefix" in given:
        raise NodeError(
            "namespace and frame_prefix are those of the robots where robots are given; leave them"
            " out, and write robots:=[floor1/robot1, floor1/robot2]"
        )
    if shared := sorted(set(robots) & set(stack.nodes)):
        raise NodeError(
            f"names of robots must differ from those of nodes, got {', '.join(shared)}; rename them"
        )
    common = {key: value for key, value in given.items() if key.partition(".")[0] not in robots}
    world = stack_parameters(stack, common)[_WORLD] | {"robots": list(robots)}
    placed = [PlacedNode(_WORLD, world)]
    for robot in robots:
        own = {
            key.removeprefix(f"{robot}."): value
            for key, value in given.items()
            if key.startswith(f"{robot}.")
        }
        for node, parameters in _parameters_of(stack, common, own, robot).items():
            remappings = stack.remappings.get(node, {})
            placed.append(PlacedNode(node, parameters, full_namespace(robot), remappings, robot))
    return placed


def _parameters_of(
    stack: Stack, common: Mapping[str, Any], own: Mapping[str, Any], robot: str
) -> dict[str, Parameters]:
    """Parameters of the nodes of one robot."""
    reached = {each for key in own for each in addressees(stack, key)}
    for key in own:
        if all(node == _WORLD for node, _ in addressees(stack, key)):
            raise NodeError(
                f"{key!r} is of {_WORLD}, which all robots share; give it without {robot!r}"
            )
    layers = stack_parameters(stack, {**common, **own})
    del layers[_WORLD]
    for node, parameters in layers.items():
        fields = CONFIGS[node].model_fields
        if "frame_prefix" in fields:
            parameters["frame_prefix"] = f"{full_namespace(robot).strip('/')}/"
        for name in _PATHS:
            if name not in fields or (node, name) in reached:
                continue
            path = Path(str(parameters.get(name, fields[name].default)))
            if path.name:
                parameters[name] = str(path.parent / robot / path.name)
    return layers
