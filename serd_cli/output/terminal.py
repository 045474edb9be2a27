"""Terminal output: results and JSON on stdout, progress and errors on stderr."""

import json
import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Table

if TYPE_CHECKING:
    from serd_files.table import Row
    from serd_sim.episodes.batch import Progress as EpisodeProgress

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
    floats = {name: finite(value) for name, value in values.items() if isinstance(value, float)}
    return values | floats


def table_of(title: str, first: str, numbers: Iterable[str], **options: Any) -> Table:
    """A table with a column of text, which is folded, and columns of numbers."""
    table = Table(title=title, title_justify="left")
    table.add_column(first, overflow="fold")
    for name in numbers:
        table.add_column(name, justify="right", **options)
    return table


def facts_table(rows: Iterable[tuple[str, str]]) -> Table:
    """A table without a heading: names, and what is folded beside them."""
    table = Table(show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for row in rows:
        table.add_row(*row)
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


@contextmanager
def results_kept_in(place: Path | None) -> Iterator[None]:
    """At Ctrl-C, print where the finished results are; place: None for none."""
    try:
        yield
    except KeyboardInterrupt:
        if place is not None and place.exists():
            progress_console.print(
                f"results are in {place.resolve()}; rerun the command to resume", soft_wrap=True
            )
        raise


def run_episodes(output: Path, run: "Callable[[EpisodeProgress], list[Row]]") -> "list[Row]":
    """The rows of `run`, with a bar of its episodes; their table `output` remains at Ctrl-C."""
    with results_kept_in(output), counting_bar("episodes") as bar:
        line = bar.add_task("", total=None, visible=False)
        return run(lambda done, total: bar.update(line, completed=done, total=total, visible=True))
