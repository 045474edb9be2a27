"""Runs a stack of nodes to its end with a progress bar, in a ROS domain of its own."""

import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from subprocess import PIPE, run
from typing import Any, TextIO

from domain_coordinator import domain_id
from rich.markup import escape
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Column

from serd_cli.errors import BAD_INPUT, RunError
from serd_cli.output.terminal import WorkProgress
from serd_cli.processes.node_commands import stack_processes
from serd_cli.processes.supervisor import run_together
from serd_cli.processes.workspace import ros_environment
from serd_ros.graph.graph import Stack, find_stack, full_namespace, load_graph
from serd_ros.process.progress import VARIABLE, parse_progress

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


def require_free_domain(
    stack: Stack, environment: Mapping[str, str], namespace: str = "", robots: Sequence[str] = ()
) -> None:
    """RunError names the nodes that publish a world where the stack would publish its own."""
    if load_graph().has_world(stack):
        places = [full_namespace(robot) for robot in robots] or [namespace]
        poses = (f"{place}/robot_pose" for place in places)
        require_free(environment, f"{namespace}/clock", *poses)


def require_free(environment: Mapping[str, str], *names: str) -> None:
    """RunError names the nodes that publish one of the topics."""
    words = [sys.executable, "-m", "serd_ros.process.domain_check", *names]
    found = run(words, env=dict(environment), stdout=PIPE, text=True, check=False)
    if found.returncode == BAD_INPUT:
        raise RunError(found.stdout.strip(), BAD_INPUT)


def run_stack(
    name: str,
    parameters: Mapping[str, Any],
    environment: Mapping[str, str],
    *,
    total: int,
    logs: Path,
    composed: bool = False,
) -> None:
    """Run a stack until one of its nodes ends; total: how many parts its progress has.

    composed: as `stack_processes` takes it.
    What the nodes print goes to `NAME.log` in the folder of logs.
    """
    require_free_domain(find_stack(name), environment)
    processes = stack_processes(find_stack(name), parameters, environment, composed=composed)
    with StackProgress(name, total, logs / f"{name}.log") as progress:
        run_together(processes, environment, progress.take_line)
        progress.finish()


class StackProgress:
    """A bar over `total` parts; every other line of the nodes goes to the log file."""

    def __init__(self, title: str, total: int, log: Path) -> None:
        log.parent.mkdir(parents=True, exist_ok=True)
        self._log_path = log
        self._log: TextIO | None = None
        self._bar = WorkProgress(
            TextColumn("{task.description:<12}"),
            BarColumn(bar_width=20),
            TaskProgressColumn(),
            TimeElapsedColumn(),
            TextColumn("[dim]{task.fields[text]}", table_column=Column(no_wrap=True, ratio=1)),
            expand=True,
        )
        self._task = self._bar.add_task(title, total=total, text="starting the nodes")

    def __enter__(self) -> "StackProgress":
        self._log = self._log_path.open("a", encoding="utf-8")
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()
        if self._log is not None:
            self._log.close()

    def take_line(self, node: str, line: str) -> None:
        """Take a line that a node printed."""
        progress = parse_progress(line)
        if progress is not None:
            text = progress.text
            short = text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"
            self._bar.update(self._task, text=escape(short), completed=progress.done)
        elif self._log is not None:
            self._log.write(f"{node:>15} | {line}\n")
            self._log.flush()

    def finish(self) -> None:
        """Fill the bar."""
        self._bar.update(self._task, completed=self._bar.tasks[0].total)
