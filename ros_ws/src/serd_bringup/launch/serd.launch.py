# Copyright 2026 The SERD developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Starts a stack of serd_ros/graph/graph.yaml, the description that `serd launch` uses too.

    ros2 launch serd_bringup serd.launch.py stack:=live seed:=3

Installed under the name of a stack, this file starts that one, with the arguments of its nodes
alone; under simulation.launch.py it starts the stack `live`:

    ros2 launch serd_bringup navigate.launch.py model:=model.yaml

Every parameter that a node of the stack has is a launch argument; `node.parameter:=value` is that
of one node. Empty means the stack's own value. Values of `params_file` override those of the
stack, and arguments override both. Any other argument is refused, unless another file includes
this one, whose arguments are visible here.
"""

from contextlib import suppress
from functools import partial
from itertools import pairwise
from pathlib import Path
import sys

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from serd_files.settings import settings_of
from serd_ros.graph.graph import (
    addressees,
    config_of,
    find_stack,
    full_namespace,
    load_graph,
    PACKAGE,
    placed_nodes,
)
import yaml

BRINGUP = 'serd_bringup'
NAME = Path(__file__).name.partition('.')[0]
OWN = {
    'namespace': 'of all nodes, and of the clock of a simulator',
    'use_sim_time': 'true or false for all nodes',
    'params_file': 'parameters of the nodes by name, as YAML',
}


def descriptions(nodes):
    """Return what each parameter of the nodes that can run here sets, by its name."""
    found = {}
    for node in nodes:
        with suppress(ModuleNotFoundError):  # a robot has no simulator
            found |= {each.name: each.description for each in settings_of(config_of(node))}
    return found


def is_included():
    """Whether `ros2 launch` was called with a file of another package."""
    here = Path(__file__).parent
    ours = {each.name for each in here.glob('*.launch.py')}
    return not any(
        Path(file).name in ours and (package == BRINGUP or Path(file).resolve().parent == here)
        for package, file in pairwise(sys.argv)
    )


def given_parameters(context, own):
    """All arguments but empty ones and those of this file; those of an including file are left."""
    nodes, included = load_graph().nodes, is_included()
    known = descriptions(nodes) if included else {}
    given = {}
    for name, text in context.launch_configurations.items():
        node, dot, _ = name.partition('.')
        ours = name in known or (dot and node in nodes)
        if text and name not in own and (ours or not included):
            given[name] = yaml.safe_load(text)
    return given


def layers_of(context, stack, given):
    """Return what sets the parameters of a node, the later the stronger."""
    file = LaunchConfiguration('params_file').perform(context)
    sim_time = LaunchConfiguration('use_sim_time').perform(context)
    named = {node: {} for node in stack.nodes}
    for key, value in given.items():
        for node, name in addressees(stack, key):
            named[node][name] = value

    def layers(node, parameters):
        times = [{'use_sim_time': yaml.safe_load(sim_time)}] if sim_time else []
        return [parameters, *([file, named[node]] if file else []), *times]

    return layers


def nodes_of_stack(context, name=''):
    """name: of the stack; empty where an argument has it."""
    own = OWN if name else ('stack', *OWN)
    stack = find_stack(name or LaunchConfiguration('stack').perform(context))
    given = given_parameters(context, own)
    layers = layers_of(context, stack, given)
    namespace = full_namespace(LaunchConfiguration('namespace').perform(context))
    return [
        Node(
            package=PACKAGE,
            executable=each.node,
            name=each.node,
            namespace=LaunchConfiguration('namespace'),
            parameters=layers(each.node, each.parameters),
            remappings=list(each.remappings.items()),
            output='screen',
            on_exit=EmitEvent(event=Shutdown(reason=f'{each.node} ended')),
        )
        for each in placed_nodes(stack, given, namespace)
    ]


def declared(texts):
    """Arguments that are empty by default."""
    return [
        DeclareLaunchArgument(name, default_value='', description=text)
        for name, text in (*OWN.items(), *sorted(texts.items()))
    ]


def description_of(name):
    """Return the launch file of one stack."""
    arguments = declared(descriptions(find_stack(name).nodes))
    return LaunchDescription(
        [*arguments, OpaqueFunction(function=partial(nodes_of_stack, name=name))]
    )


def generate_launch_description():
    if NAME != 'serd':
        return description_of({'simulation': 'live'}.get(NAME, NAME))
    stacks = load_graph().stacks
    about = '; '.join(f'{name}: {stack.about}' for name, stack in stacks.items())
    chosen = DeclareLaunchArgument('stack', default_value='live', description=about)
    return LaunchDescription(
        [
            chosen,
            *declared(descriptions(load_graph().nodes)),
            OpaqueFunction(function=nodes_of_stack),
        ]
    )
