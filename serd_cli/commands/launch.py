"""serd launch live seed:=3 local_planner.max_vel_x:=0.5
serd launch goto namespace:=robot1 goal:=12,18 model:=model.yaml

Without a stack all stacks are listed. When one of the nodes ends, all end. Ctrl-C ends all.
"""

import os
import sys
from typing import Annotated

from rich.text import Text

from serd_cli.options import AsJson, arg
from serd_cli.output.terminal import console, print_json
from serd_cli.processes.node_commands import parse_assignment, stack_processes
from serd_cli.processes.stack_run import require_free_domain
from serd_cli.processes.supervisor import run_together
from serd_cli.processes.workspace import ros_environment
from serd_ros.graph.graph import find_stack, full_namespace, load_graph


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
    require_free_domain(found, environment, namespace)
    run_together(
        processes, environment, lambda name, line: print(f"{name:>15} | {line}", file=sys.stderr)
    )
