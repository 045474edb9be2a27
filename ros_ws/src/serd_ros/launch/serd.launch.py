"""ros2 launch serd_ros serd.launch.py stack:=live seed:=3

Starts a stack of serd_ros/graph/graph.yaml, the description that `serd launch` uses too. Every
parameter that a node of the stack has is a launch argument; empty means the stack's own value.
"""

import yaml
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from serd_ros.graph.configs import CONFIGS
from serd_ros.graph.graph import PACKAGE, find_stack, load_graph, stack_parameters


def parameter_names():
    return sorted({name for config in CONFIGS.values() for name in config.model_fields})


def nodes_of_stack(context):
    stack = find_stack(LaunchConfiguration("stack").perform(context))
    given = {}
    for name in parameter_names():
        text = LaunchConfiguration(name).perform(context)
        if text:
            given[name] = yaml.safe_load(text)
    return [
        Node(
            package=PACKAGE,
            executable=node,
            name=node,
            parameters=[parameters],
            remappings=list(stack.remappings.get(node, {}).items()),
            output="screen",
            on_exit=EmitEvent(event=Shutdown(reason=f"{node} ended")),
        )
        for node, parameters in stack_parameters(stack, given).items()
    ]


def generate_launch_description():
    stacks = load_graph().stacks
    about = "; ".join(f"{name}: {stack.about}" for name, stack in stacks.items())
    return LaunchDescription(
        [
            DeclareLaunchArgument("stack", default_value="live", description=about),
            *(DeclareLaunchArgument(name, default_value="") for name in parameter_names()),
            OpaqueFunction(function=nodes_of_stack),
        ]
    )
