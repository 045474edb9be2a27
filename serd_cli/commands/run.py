"""serd run serd_ros hallway_sim --ros-args -p seed:=3

The process becomes the node, so exit code and signals are the node's own. Without a package all
packages and their executables are listed.
"""

import os
from typing import Annotated

import typer

from serd_cli.options import AsJson, arg
from serd_cli.output.terminal import console, print_json
from serd_cli.processes.node_commands import all_executables, find_command
from serd_cli.processes.workspace import ros_environment


def run(
    context: typer.Context,
    package: Annotated[str, arg("ROS package, for example serd_ros")] = "",
    executable: Annotated[str, arg("its executable, for example hallway_sim")] = "",
    as_json: AsJson = False,
) -> None:
    """Find the executable and become it, or list all."""
    environment = ros_environment(os.environ)
    if package:
        command = find_command(package, executable, environment)
        os.execve(command[0], [*command, *context.args], environment)
    found = all_executables(environment)
    if as_json:
        print_json(found)
        return
    for name, executables in found.items():
        console.print(name, style="bold")
        console.print(f"  {', '.join(executables)}", style="dim")
