"""The web page on which the drives of a demo are watched while they last."""

import os
import sys
import webbrowser
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from rich.text import Text

from serd_cli.output.terminal import progress_console
from serd_cli.processes.node_commands import node_command
from serd_cli.processes.stack_run import log_of_nodes, port_fault
from serd_cli.processes.supervisor import Process, running_beside
from serd_ros.graph.configs import WatchPageConfig
from serd_ros.process.progress import VARIABLE, parse_progress

_NODE = "watch_page"


@contextmanager
def live_page(scenario: str, environment: Mapping[str, str], logs: Path) -> Iterator[None]:
    """Serve the page within the context, at one address for all stacks that run in it.

    The address is printed, and opened in a browser where there is a display. Where no page can be
    served, a sentence names the reason, and the drives go on.
    """
    settings = WatchPageConfig(scenario=scenario)
    if port_fault(settings.address, settings.port):
        settings = settings.model_copy(update={"port": 0})  # any free one
    command = node_command(_NODE, settings.model_dump(), {}, environment)
    last_line = ""

    def take(node: str, line: str) -> None:
        nonlocal last_line
        progress = parse_progress(line)
        if progress is None:
            last_line = line
            log(node, line)
        elif progress.address:
            _show(progress.address)

    def ended() -> None:
        progress_console.print(f"no page shows the drives: {last_line}", soft_wrap=True)

    with (
        log_of_nodes(logs / f"{_NODE}.log") as log,
        running_beside(Process(_NODE, command), {**environment, VARIABLE: "1"}, take, ended),
    ):
        yield


def _show(address: str) -> None:
    progress_console.print(Text.assemble("watch the drives at ", (address, "bold")))
    has_display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if has_display and sys.stdout.isatty():
        webbrowser.open(address)
