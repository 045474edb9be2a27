"""Where the nodes of a stack run: one namespace, or one for each robot of a world."""

import pytest

from serd_ros.errors import NodeError
from serd_ros.graph.graph import find_stack
from serd_ros.graph.placement import placed_nodes

ROBOTS = ("robot1", "floor2/robot2")


def placed(stack, given, **options):
    return {
        (each.robot, each.node): each for each in placed_nodes(find_stack(stack), given, **options)
    }


def test_a_stack_in_a_namespace_has_its_clock_there():
    nodes = placed("demonstrate", {"seed": 4}, namespace="/robot1")
    assert {each.namespace for each in nodes.values()} == {"/robot1"}
    assert nodes["", "guard"].remappings == {"/clock": "/robot1/clock"}
    assert nodes["", "hallway_sim"].parameters["seed"] == 4


def test_robots_share_the_simulator_and_have_all_other_nodes_and_frames_each():
    nodes = placed("demonstrate", {"seed": 4}, robots=ROBOTS)
    stack = find_stack("demonstrate").nodes
    assert set(nodes) == {("", "hallway_sim")} | {
        (robot, node) for robot in ROBOTS for node in stack if node != "hallway_sim"
    }
    world = nodes["", "hallway_sim"]
    assert (world.namespace, world.parameters["robots"]) == ("", list(ROBOTS))
    guard = nodes["floor2/robot2", "guard"]
    assert (guard.namespace, guard.parameters["frame_prefix"]) == (
        "/floor2/robot2",
        "floor2/robot2/",
    )
    assert guard.remappings == {}
    assert nodes["robot1", "scripted_expert"].parameters["seed"] == 4


def test_a_parameter_of_one_robot_reaches_its_nodes_alone():
    given = {"robot1.goal": "1, 2", "floor2/robot2.strategy.seed": 9, "seed": 4, "model": "m.yaml"}
    nodes = placed("navigate", given, robots=ROBOTS)
    first, second = (nodes[robot, "strategy"].parameters for robot in ROBOTS)
    assert (first["goal"], first["seed"]) == ("1, 2", 4)
    assert second["seed"] == 9
    assert "goal" not in second
    assert "goal" not in nodes["", "hallway_sim"].parameters
    assert nodes["", "hallway_sim"].parameters["seed"] == 4


def test_robots_write_to_folders_of_their_own():
    given = {"scripted_expert.output": "/data/drives", "robot1.demo_recorder.output": "first"}
    nodes = placed("demonstrate", given, robots=ROBOTS)
    outputs = {
        robot: [
            nodes[robot, node].parameters["output"] for node in ("demo_recorder", "scripted_expert")
        ]
        for robot in ROBOTS
    }
    assert outputs == {
        "robot1": ["first", "/data/robot1/drives"],
        "floor2/robot2": ["floor2/robot2/recording", "/data/floor2/robot2/drives"],
    }
    silent = placed("demonstrate", {}, robots=ROBOTS)
    assert silent["robot1", "scripted_expert"].parameters["output"] == ""


@pytest.mark.parametrize(
    ("stack", "given", "options", "sentence"),
    [
        ("learn", {}, {}, "robots need a stack with hallway_sim, got learner"),
        ("live", {}, {"namespace": "/fleet"}, "namespace and frame_prefix are those of the robots"),
        ("live", {"frame_prefix": "a/"}, {}, "namespace and frame_prefix are those of the robots"),
        ("live", {"robot1.hallway_sim.seed": 3}, {}, "of hallway_sim, which all robots share"),
        ("live", {"hallway_sim.robots": ["a"]}, {}, "got hallway_sim.robots; write robots:="),
        ("live", {"robot1.sede": 3}, {}, "did you mean 'seed'"),
        ("live", {"robot3.seed": 3}, {}, "'robot3.seed' names no node of this stack"),
    ],
)
def test_what_robots_in_one_world_cannot_have_is_refused(stack, given, options, sentence):
    with pytest.raises(NodeError, match=sentence):
        placed(stack, given, robots=ROBOTS, **options)


def test_nodes_of_robots_are_not_started_by_a_parameter_of_the_simulator_alone():
    with pytest.raises(NodeError, match=r"write robots:=\[robot1, robot2\]"):
        placed("live", {"hallway_sim.robots": ["robot1"]})


def test_a_robot_with_the_name_of_a_node_is_refused():
    with pytest.raises(NodeError, match="must differ from those of nodes, got guard"):
        placed("live", {}, robots=("guard", "robot2"))
