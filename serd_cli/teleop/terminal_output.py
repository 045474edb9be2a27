"""Output of the nodes while driving by hand: all of it in a log, the driver's part on screen."""

import re
import termios
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from rich.text import Text

from serd_cli.output.terminal import progress_console
from serd_cli.teleop.settings import KEYBOARD, PAGE
from serd_ros.process.progress import parse_progress

_ROS_PREFIX = re.compile(r"^\[(\w+)\] \[[\d.]+\] \[[\w.]+\]: ")
_SHOWN = (KEYBOARD, PAGE, "teleop_mux")
_FATAL = "FATAL"


class DriverLines:
    """Logs the nodes' lines and prints those for the driver."""

    def __init__(self, log: Path) -> None:
        self._log_path = log
        self._log: TextIO | None = None
        self._shown = ""
        # Nodes whose traceback is hidden: the supervisor reports a failure that matters.
        self._broken: set[str] = set()

    def __enter__(self) -> "DriverLines":
        self._log_path.parent.mkdir(parents=True, exist_ok=True)
        self._log = self._log_path.open("a", encoding="utf-8")
        return self

    def __exit__(self, *_: object) -> None:
        if self._log is not None:
            self._log.close()

    def take(self, node: str, line: str) -> None:
        """Log a line a node printed, and print it where it is for the driver."""
        if self._log is not None:
            self._log.write(f"{node:>15} | {line}\n")
            self._log.flush()
        match = _ROS_PREFIX.match(line)
        if match and match[1] == _FATAL:
            self._broken.add(node)
        progress = parse_progress(line)
        if progress is not None:
            if progress.address:
                address = progress.address, "bold"
                progress_console.print(Text.assemble("drive at ", address, "   (Ctrl-C ends)"))
        elif node in _SHOWN and node not in self._broken:
            self._show(line[match.end() :] if match else line)

    def _show(self, text: str) -> None:
        """Print a line once: page and keyboard both report every episode."""
        if text == self._shown:
            return
        self._shown = text
        progress_console.print(text, soft_wrap=True)


@contextmanager
def restored_terminal(stream: TextIO) -> Iterator[None]:
    """Put the terminal back as it was, also where a node that changed it has been killed."""
    before = termios.tcgetattr(stream.fileno()) if stream.isatty() else None
    try:
        yield
    finally:
        if before is not None:
            termios.tcsetattr(stream.fileno(), termios.TCSADRAIN, before)
