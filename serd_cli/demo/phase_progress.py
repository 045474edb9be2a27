"""Progress of a phase on the terminal, read from what its nodes say."""

import re
from pathlib import Path
from typing import TextIO

from rich.markup import escape
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Column

from serd_cli.terminal import WorkProgress

_EPISODE = re.compile(r"episode (\d+) of \d+: (.*)")
_FIT = re.compile(r"fit (\d+) of \d+, (step .*)")
_ROS_PREFIX = re.compile(r"^\[\w+\] \[[\d.]+\] \[[\w.]+\]: ")
_LONGEST = 62


class PhaseProgress:
    """A bar over `total` parts; every line also goes to the phase's log file."""

    def __init__(self, title: str, total: int, log: Path) -> None:
        log.parent.mkdir(parents=True, exist_ok=True)
        self._log_path = log
        self._log: TextIO | None = None
        self._bar = WorkProgress(
            TextColumn("{task.description:<12}"),
            BarColumn(bar_width=20),
            TaskProgressColumn(),
            TimeElapsedColumn(),
            TextColumn("[dim]{task.fields[said]}", table_column=Column(no_wrap=True, ratio=1)),
            expand=True,
        )
        self._task = self._bar.add_task(title, total=total, said="starting the nodes")

    def __enter__(self) -> "PhaseProgress":
        self._log = self._log_path.open("a", encoding="utf-8")
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()
        if self._log is not None:
            self._log.close()

    def hear(self, node: str, line: str) -> None:
        """Take a line a node printed."""
        if self._log is not None:
            self._log.write(f"{node:>15} | {line}\n")
            self._log.flush()
        said = _ROS_PREFIX.sub("", line)
        if match := _EPISODE.search(said):
            self._show(match[2], done=int(match[1]))
        elif match := _FIT.search(said):
            self._show(match[2], done=int(match[1]) - 1)
        elif "waiting for" in said or "decisions from" in said:
            self._show(said)

    def finish(self) -> None:
        """Fill the bar."""
        total = self._bar.tasks[0].total
        self._bar.update(self._task, completed=total)

    def _show(self, said: str, done: float | None = None) -> None:
        short = said if len(said) <= _LONGEST else said[: _LONGEST - 1] + "…"
        self._bar.update(self._task, said=escape(short), completed=done)
