"""Processes of nodes that are forked from a server with all modules loaded.

An executable of a node computes for about a second before its node exists, nearly all of it in
imports. A process from the server runs the same `main`, with its own arguments, environment and
log, and ends by the same code. The server starts with the first of them, once per test worker.
"""

import importlib
import multiprocessing
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from serd_ros.graph.graph import PACKAGE, load_graph, module_of
from serd_ros.process import executable

#: The command of the stand-in robot, before its options.
STANDIN = [sys.executable, "-m", "lab.faults.standin"]
_CONTEXT = multiprocessing.get_context("forkserver")
_CONTEXT.set_forkserver_preload(
    ["serd_ros.process.run_node", *sorted({module_of(each) for each in load_graph().nodes})]
)


class NodeProcess:
    """As `subprocess.Popen` with a command; `is_node` says of which commands."""

    def __init__(self, command: Sequence[str], environment: dict[str, str], log: Path) -> None:
        self.args = [*command]
        log.touch()
        self._process = _CONTEXT.Process(
            target=_run, args=(self.args, environment, log), daemon=True
        )
        self._process.start()

    def __getattr__(self, name: str) -> Any:
        """The process's own id, `kill` and `terminate`."""
        return getattr(self._process, name)

    def poll(self) -> int | None:
        return self._process.exitcode

    returncode = property(poll)

    def wait(self, timeout: float | None = None) -> int:
        self._process.join(timeout)
        if (code := self.poll()) is None:
            raise subprocess.TimeoutExpired(self.args, timeout)
        return code

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)


def is_node(command: Sequence[str]) -> bool:
    """Whether a command starts a node of ours or the stand-in robot."""
    return Path(command[0]).parent.name == PACKAGE or _is_standin(command)


def _is_standin(command: Sequence[str]) -> bool:
    return [*command[:3]] == STANDIN


def _run(command: list[str], environment: dict[str, str], log: Path) -> None:
    os.environ.clear()
    os.environ.update(environment)
    descriptor = os.open(log, os.O_WRONLY | os.O_APPEND)
    for stream in (sys.stdout, sys.stderr):
        os.dup2(descriptor, stream.fileno())
    os.close(descriptor)
    if _is_standin(command):
        sys.argv = command[2:]
        importlib.import_module(STANDIN[2]).main()
        return
    sys.argv = command
    executable.main()
