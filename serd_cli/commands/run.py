"""`serd run`: the pip-only twin of `ros2 run`."""

import os
from typing import Annotated

import typer

from serd_cli.executables import find_command
from serd_cli.workspace import ros_environment


def register(app: typer.Typer) -> None:
    """Add the subcommand; all that follows the executable is passed on."""
    settings = {"allow_extra_args": True, "ignore_unknown_options": True}
    app.command(context_settings=settings)(run)


def run(
    context: typer.Context,
    package: Annotated[str, typer.Argument(help="ROS package, for example serd_ros")],
    executable: Annotated[str, typer.Argument(help="its executable, for example hallway_sim")],
) -> None:
    """Run one node, as `ros2 run` does: serd run serd_ros hallway_sim --ros-args -p seed:=3

    The process becomes the node, so exit code and signals are the node's own.
    """
    environment = ros_environment(os.environ)
    command = find_command(package, executable, environment)
    os.execve(command[0], [*command, *context.args], environment)
