"""serd launch live seed:=3 local_planner.max_vel_x:=0.5
serd launch goto namespace:=robot1 goal:=12,18 model:=model.yaml

Without a stack all stacks are listed. When one of the nodes ends, all end. Ctrl-C ends all.
"""

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.text import Text

from serd_app.teleop.page.server import PageAccess, read_token
from serd_cli.options import AsJson, arg, opt, resolved_scenario, validated, with_settings
from serd_cli.output.terminal import console, print_json, progress_console
from serd_cli.processes.stack_run import run_alone
from serd_cli.processes.supervisor import run_together
from serd_cli.processes.workspace import (
    find_command,
    node_command,
    parse_assignment,
    ros_environment,
    stack_processes,
)
from serd_ros.graph.graph import PACKAGE, find_stack, full_namespace, load_graph
from serd_ros.process.progress import Progress
from serd_ros.settings import WatchPageConfig
from serd_sim.scenario.scenario import load_scenario


def launch(
    stack: Annotated[str, arg("stack to start; without one all are listed")] = "",
    assignments: Annotated[
        list[str] | None, arg("name:=value, node.name:=value or namespace:=name")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Parse the assignments and run the stack, or list all."""
    stacks = load_graph().stacks
    if not stack and as_json:
        print_json({name: each.model_dump() for name, each in stacks.items()})
    for name, each in stacks.items() if not (stack or as_json) else ():
        console.print(Text.assemble((name, "bold"), f": {each.about}"))
        console.print(f"  {', '.join(each.nodes)}", style="dim")
    if not stack:
        return
    environment = ros_environment(os.environ)
    given = dict(parse_assignment(text) for text in assignments or ())
    namespace = full_namespace(str(given.pop("namespace", "")))
    found = find_stack(stack)
    processes = stack_processes(found, given, environment, namespace)
    run_together(
        processes, environment, lambda name, line: print(f"{name:>15} | {line}", file=sys.stderr)
    )


def run(
    context: typer.Context,
    package: Annotated[str, arg("ROS package; without one the nodes of serd_ros are listed")] = "",
    executable: Annotated[str, arg("its executable, for example hallway_sim")] = "",
) -> None:
    """serd run serd_ros hallway_sim --ros-args -p seed:=3

    The process becomes the node, so exit code and signals are the node's own.
    """
    if not package:
        console.print(f"serd run {PACKAGE} NODE, where NODE is {', '.join(load_graph().nodes)}")
        return
    environment = ros_environment(os.environ)
    command = find_command(package, executable, environment)
    os.execve(command[0], [*command, *context.args], environment)


@with_settings(WatchPageConfig)
def watch(
    namespace: Annotated[
        str, opt("of the robot that is shown, as robot1; / for topics without one")
    ] = "",
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """serd watch

    The page shows what others have started with 'serd launch', or play with
    'serd bag play', in the same ROS domain. It publishes no command, and the
    viewer needs a browser only.

    One of several robots is shown with --namespace robot1, and with
    --frame-prefix robot1/ where its stack has a frame_prefix.

    With --json the address of the page is printed as JSON. Ctrl-C ends.
    """
    options["scenario"] = resolved_scenario(options["scenario"])
    if options["token_file"]:
        options["token_file"] = str(Path(options["token_file"]).resolve())
    settings = validated(WatchPageConfig, **options)
    PageAccess(settings.address, read_token(settings.token_file))
    load_scenario(settings.scenario)
    environment = ros_environment(os.environ)
    remappings = {"__ns": full} if (full := full_namespace(namespace)) else {}
    command = node_command("watch_page", settings.model_dump(), remappings, environment)

    def take(progress: Progress) -> None:
        if progress.address and as_json:
            print_json({"url": progress.address})
            sys.stdout.flush()
        elif progress.address:
            address = progress.address, "bold"
            progress_console.print(Text.assemble("watch at ", address, "   (Ctrl-C ends)"))

    with suppress(KeyboardInterrupt):  # the usual end
        run_alone("watch_page", command, environment, take)
