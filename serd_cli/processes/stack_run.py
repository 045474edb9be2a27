"""Runs nodes: a stack to its end with a progress bar, one alone, or one that plays a bag."""

import os
import socket
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from domain_coordinator import domain_id
from rich.markup import escape

from serd_bag.reader import BagReader
from serd_bag.topic import selected_topics
from serd_cli.errors import UsageError
from serd_cli.output.terminal import counting_bar
from serd_cli.processes.supervisor import Line, Process, run_together
from serd_cli.processes.workspace import node_command, ros_environment, stack_processes
from serd_ros.graph.graph import Stack, find_stack
from serd_ros.process.progress import VARIABLE, Progress, parse_progress
from serd_ros.settings import BagReplayConfig

PAGE = "watch_page"
_LONGEST = 62


@contextmanager
def stack_environment(logs: Path) -> Iterator[dict[str, str]]:
    """Environment of nodes in a ROS domain of their own; their logs go to the folder."""
    with domain_id() as domain:
        environment = ros_environment(os.environ)
        environment |= {"ROS_DOMAIN_ID": str(domain), "ROS_LOG_DIR": str(logs / "ros")}
        environment[VARIABLE] = "1"
        environment.setdefault("OMP_NUM_THREADS", "1")
        environment.setdefault("OPENBLAS_NUM_THREADS", "1")
        yield environment


def port_fault(address: str, port: int) -> str:
    """Why no server can have a port; empty where one can. Port 0 is any free one."""
    with socket.socket(socket.AF_INET6 if ":" in address else socket.AF_INET) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address, port))
        except OSError as error:
            return error.strerror or str(error)
    return ""


def run_stack(
    name: str,
    parameters: Mapping[str, Any],
    environment: Mapping[str, str],
    *,
    total: int,
    logs: Path,
    on_address: Callable[[str], object] | None = None,
) -> None:
    """Run a stack until one of its nodes ends; total: how many parts its progress has.

    What the nodes print goes to `NAME.log` in the folder of logs. on_address: called with the
    address of a page that shows the stack, which is one of its nodes only then.
    """
    stack = find_stack(name) if on_address is None else _watched(find_stack(name))
    processes = stack_processes(stack, parameters, environment)
    bar = counting_bar("{task.description:<12}", "[dim]{task.fields[text]}", bar_width=20)
    task = bar.add_task(name, total=total, text="starting the nodes")
    with log_of_nodes(logs / f"{name}.log") as log, bar:

        def take(node: str, line: str) -> None:
            if (progress := parse_progress(line)) is None:
                log(node, line)
            elif progress.address and on_address is not None:
                on_address(progress.address)
            else:
                text = progress.text
                short = text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"
                bar.update(task, text=escape(short), completed=progress.done)

        run_together(processes, environment, take)
        bar.update(task, completed=total)


def _watched(stack: Stack) -> Stack:
    """The stack with a page, for which its world waits."""
    world = stack.parameters["hallway_sim"]
    waiting = {**world, "required_nodes": [*world["required_nodes"], PAGE]}
    nodes, parameters = (*stack.nodes, PAGE), {**stack.parameters, "hallway_sim": waiting}
    return stack.model_copy(update={"nodes": nodes, "parameters": parameters})


def run_alone(
    node: str,
    command: Sequence[str],
    environment: Mapping[str, str],
    take: Callable[[Progress], object],
) -> None:
    """Run one node; take: called with its reports. Its other lines go to stderr."""

    def take_line(_: str, line: str) -> None:
        if (progress := parse_progress(line)) is None:
            print(line, file=sys.stderr, flush=True)
        else:
            take(progress)

    run_together([Process(node, command)], {**environment, VARIABLE: "1"}, take_line)


@contextmanager
def log_of_nodes(path: Path) -> Iterator[Line]:
    """What appends a line of a node to a file, at once; makes the folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8", buffering=1) as file:
        yield lambda node, line: print(f"{node:>15} | {line}", file=file)


def replay(settings: BagReplayConfig, remappings: Mapping[str, str]) -> None:
    """Run the node that plays a bag in place of this process."""
    names = [name for name in settings.topics if name]
    selected_topics(BagReader(Path(settings.bag)).topics, names)
    environment = ros_environment(os.environ)
    parameters = settings.model_dump(exclude_unset=True)
    command = node_command("bag_replay", parameters, remappings, environment)
    os.execve(command[0], command, environment)


def parse_remappings(pairs: Sequence[str]) -> dict[str, str]:
    """FROM:=TO as a dictionary; UsageError for another form."""
    for pair in pairs:
        before, _, after = pair.partition(":=")
        if not (before and after):
            raise UsageError(f"--remap must be written FROM:=TO, got {pair!r}")
    return {before: after for before, _, after in (pair.partition(":=") for pair in pairs)}
