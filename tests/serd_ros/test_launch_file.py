"""The ROS launch file against stand-ins for launch and launch_ros, which have no wheels.

The stand-ins keep what they are given; what a real launch makes of it was not run here.
"""

import runpy
import sys
from types import ModuleType

import pytest

from serd_ros.graph.graph import find_stack, stack_parameters


class Kept:
    """Keeps its arguments."""

    def __init__(self, *words, **named):
        self.words, self.named = words, named


class Configuration(Kept):
    """Looks its name up in the context."""

    def perform(self, context):
        return context[self.words[0]]


@pytest.fixture
def launch_file(root, monkeypatch):
    names = {
        "launch": {"LaunchDescription": Kept},
        "launch.actions": dict.fromkeys(
            ("DeclareLaunchArgument", "EmitEvent", "OpaqueFunction"), Kept
        ),
        "launch.events": {"Shutdown": Kept},
        "launch.substitutions": {"LaunchConfiguration": Configuration},
        "launch_ros": {},
        "launch_ros.actions": {"Node": Kept},
    }
    for name, content in names.items():
        module = ModuleType(name)
        module.__dict__.update(content)
        monkeypatch.setitem(sys.modules, name, module)
    return runpy.run_path(str(root / "ros_ws/src/serd_ros/launch/serd.launch.py"))


def test_every_parameter_is_a_launch_argument(launch_file):
    (entities,) = launch_file["generate_launch_description"]().words
    declared = {entity.words[0] for entity in entities if entity.words}
    assert {"stack", "seed", "scenario", "lockstep", "model", "bag"} <= declared


def test_a_stack_starts_the_nodes_and_parameters_of_the_graph(launch_file):
    context = dict.fromkeys(launch_file["parameter_names"](), "")
    context |= {"stack": "demonstrate", "seed": "7"}
    nodes = launch_file["nodes_of_stack"](context)
    expected = stack_parameters(find_stack("demonstrate"), {"seed": 7})
    assert {node.named["executable"]: node.named["parameters"] for node in nodes} == {
        name: [parameters] for name, parameters in expected.items()
    }
    assert {node.named["package"] for node in nodes} == {"serd_ros"}


def test_a_topic_that_has_another_name_in_a_stack_is_remapped(launch_file):
    context = dict.fromkeys(launch_file["parameter_names"](), "") | {"stack": "teleop"}
    nodes = launch_file["nodes_of_stack"](context)
    remapped = {node.named["executable"]: node.named["remappings"] for node in nodes}
    assert remapped.pop("local_planner") == [("cmd_vel_raw", "cmd_vel_planner")]
    assert not any(remapped.values())


def test_an_argument_that_no_node_of_the_stack_has_is_refused(launch_file):
    context = dict.fromkeys(launch_file["parameter_names"](), "")
    context |= {"stack": "live", "model": "model.yaml"}
    with pytest.raises(Exception, match="no node of this stack has a parameter 'model'"):
        launch_file["nodes_of_stack"](context)
