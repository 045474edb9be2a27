"""Terminal output: results and JSON on stdout, progress and errors on stderr."""

import json
import math
import time
from collections.abc import Iterable
from datetime import timedelta
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

# Without markup, for names of files and topics may have brackets; `Text` has the styles.
console = Console(highlight=False, markup=False, emoji=False)
progress_console = Console(stderr=True, highlight=False, markup=False, emoji=False)


def print_json(values: Any) -> None:
    """Print plain values; paths become text, and numbers that are not finite are refused."""
    print(json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False, default=str))


def finite(value: float) -> float | None:
    """The number; None for NaN and infinity, which JSON does not have."""
    return float(value) if math.isfinite(value) else None


def finite_values(values: dict[str, Any]) -> dict[str, Any]:
    """The values with None for floats that are not finite."""
    return {
        name: finite(value) if isinstance(value, float) else value for name, value in values.items()
    }


def table_of(title: str, first: str, numbers: Iterable[str], **options: Any) -> Table:
    """A table with a column of text, which is folded, and columns of numbers."""
    table = Table(title=title, title_justify="left")
    table.add_column(first, overflow="fold")
    for name in numbers:
        table.add_column(name, justify="right", **options)
    return table


_LINE_EVERY_S = 30.0


class WorkProgress(Progress):
    """rich's progress bar; without a terminal it prints a line every half minute."""

    def __init__(self, *columns: str | ProgressColumn, expand: bool = False) -> None:
        super().__init__(*columns, console=progress_console, expand=expand)
        self._printed_at_s = time.monotonic()

    def update(self, task_id: TaskID, *args: Any, **kwargs: Any) -> None:
        """Update a task; without a terminal, print a line if the last one is old."""
        super().update(task_id, *args, **kwargs)
        if self.console.is_terminal or time.monotonic() - self._printed_at_s < _LINE_EVERY_S:
            return
        self._printed_at_s = time.monotonic()
        self.console.print(self.get_renderable())


def counting_bar(text: str, *more: str, bar_width: int | None = 40) -> WorkProgress:
    """A bar of tasks that are counted, with the number done and the time left; more: columns."""
    counts = BarColumn(bar_width), MofNCompleteColumn(), TimeRemainingColumn()
    return WorkProgress(TextColumn(text), *counts, *map(TextColumn, more))


def time_left_s(done_s: float, total_s: float, spent_s: float, n_processes: int) -> float:
    """Seconds for the rest, when done_s of total_s seconds of work took spent_s so far.

    Before anything is done, the estimated costs are divided by the number of processes.
    """
    speed = done_s / spent_s if done_s > 0 and spent_s > 0 else float(n_processes)
    return max(total_s - done_s, 0.0) / speed


class TimeLeftColumn(ProgressColumn):
    """`left 0:12:34` for few long pieces of work of roughly known cost.

    rich's own estimate uses the last seconds only, in which no piece may have ended.
    """

    def __init__(self, n_processes: int) -> None:
        super().__init__()
        self._n_processes = n_processes
        self._done_s, self._at_s = 0.0, 0.0

    def render(self, task: Task) -> Text:
        """The estimate made when the last piece ended, minus the time since."""
        if task.total is None:
            return Text("")
        now_s = task.elapsed or 0.0
        if task.completed != self._done_s:
            self._done_s, self._at_s = task.completed, now_s
        left_s = time_left_s(self._done_s, task.total, self._at_s, self._n_processes)
        return Text(f"left {timedelta(seconds=round(max(left_s - (now_s - self._at_s), 0.0)))}")
