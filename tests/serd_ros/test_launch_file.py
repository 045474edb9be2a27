"""The ROS launch file against stand-ins for launch and launch_ros, which have no wheels.

The stand-ins keep what they are given; what a real launch makes of it was not run here.
"""

import ast
import runpy
import shutil
import sys
from types import ModuleType, SimpleNamespace

import pytest

from serd_ros.graph.graph import config_of, find_stack, load_graph, stack_parameters

PACKAGE = "ros_ws/src/serd_bringup"
#: The stack of each file.
FILES = {
    "simulation": "live",
    **{each: each for each in ("demonstrate", "learn", "navigate", "teleop", "robot", "nav2")},
    "robot_nav2": "robot_nav2",
    "robot_people": "robot_people",
}


class Kept:
    """Keeps its arguments."""

    def __init__(self, *words, **named):
        self.words, self.named = words, named


class Configuration(Kept):
    """Looks its name up in the context."""

    def perform(self, context):
        return context.launch_configurations[self.words[0]]


def started_by(launch_file, **given):
    """What nodes get by name; launch looks up what is not given as the file declares it."""
    names = *launch_file["OWN"], *launch_file["descriptions"](load_graph().nodes)
    context = SimpleNamespace(launch_configurations=dict.fromkeys(names, "") | given)
    return {each.named["name"]: each.named for each in launch_file["nodes_of_stack"](context)}


@pytest.fixture
def installed(root, tmp_path):
    """The folder of the launch files as the package installs them."""
    for name in ("serd", *FILES):
        shutil.copyfile(root / PACKAGE / "launch/serd.launch.py", tmp_path / f"{name}.launch.py")
    return tmp_path


@pytest.fixture
def launch_file(installed, monkeypatch):
    names = "LaunchDescription DeclareLaunchArgument EmitEvent OpaqueFunction Shutdown Node"
    everything = dict.fromkeys(names.split(), Kept) | {"LaunchConfiguration": Configuration}
    for part in ("", ".actions", ".events", ".substitutions"):
        for name in (f"launch{part}", f"launch_ros{part}"):
            module = ModuleType(name)
            module.__dict__.update(everything)
            monkeypatch.setitem(sys.modules, name, module)
    return runpy.run_path(str(installed / "serd.launch.py"))


def test_a_stack_starts_its_nodes_with_the_parameters_of_the_graph_and_its_remappings(launch_file):
    started = started_by(launch_file, stack="demonstrate", seed="7")
    expected = stack_parameters(find_stack("demonstrate"), {"seed": 7})
    for name, named in started.items():
        assert (named["package"], named["parameters"]) == ("serd_ros", [expected.pop(name)])
    assert not expected
    teleop = started_by(launch_file, stack="teleop")
    remapped = {name: named["remappings"] for name, named in teleop.items()}
    assert remapped.pop("local_planner") == [("cmd_vel_raw", "cmd_vel_planner")]
    assert not any(remapped.values())


def test_a_file_of_parameters_overrides_the_stack_and_arguments_override_the_file(launch_file):
    given = {"params_file": "robot.yaml", "use_sim_time": "true", "hallway_sim.seed": "7"}
    started = started_by(launch_file, stack="live", **given)
    stack, *rest = started["hallway_sim"]["parameters"]
    assert stack["seed"] == 7
    assert rest == ["robot.yaml", {"seed": 7}, {"use_sim_time": True}]
    assert started["guard"]["parameters"][1:] == ["robot.yaml", {}, {"use_sim_time": True}]


def description_of(installed, name):
    """The arguments by name, and what makes the nodes, of a file."""
    file = runpy.run_path(str(installed / f"{name}.launch.py"))
    (entities,) = file["generate_launch_description"]().words
    arguments = {each.words[0]: each.named for each in entities if each.words}
    (nodes_of,) = [each.named["function"] for each in entities if not each.words]
    return arguments, nodes_of


@pytest.mark.usefixtures("launch_file")
def test_the_file_of_each_stack_has_its_arguments_and_starts_its_nodes(installed, root):
    tree = ast.parse((root / PACKAGE / "setup.py").read_text())
    assigned = [each for each in tree.body if isinstance(each, ast.Assign)]
    (names,) = (each.value for each in assigned if ast.unparse(each.targets[0]) == "LAUNCH_FILES")
    assert set(ast.literal_eval(names)) == set(FILES)
    for name, stack_name in FILES.items():
        arguments, nodes_of = description_of(installed, name)
        stack = find_stack(stack_name)
        known = {each for node in stack.nodes for each in config_of(node).model_fields}
        assert set(arguments) == known | {"namespace", "use_sim_time", "params_file"}
        assert all(each["description"] for each in arguments.values())
        given = dict.fromkeys(arguments, "") | {"namespace": "robot1"}
        nodes = nodes_of(SimpleNamespace(launch_configurations=given))
        assert [each.named["executable"] for each in nodes] == list(stack.nodes)
