"""Processor time and memory; results as JSON in lab/results, and as a table on the terminal."""

import json
import os
import platform
import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from lab import RESULTS
from lab.experiments.running.provenance import code_commit
from serd_bag.files import atomic_write_text

Row = Mapping[str, Any]


def save(
    name: str, about: str, rows: Sequence[Row], details: Mapping[str, Any] | None = None
) -> None:
    """Write lab/results/<name>.json with the commit and date of the code, and print its rows."""
    machine = {
        "processor": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
    }
    measured = {"commit": code_commit(), "date": datetime.now(timezone.utc).date().isoformat()}
    content = {"about": about, "measured": measured, "machine": machine}
    content |= {"rows": [dict(row) for row in rows]}
    content |= {"details": dict(details)} if details else {}
    atomic_write_text(RESULTS / f"{name}.json", json.dumps(content, indent=2) + "\n")
    table = Table(title=about, title_justify="left")
    for column in rows[0]:
        table.add_column(column)
    for row in rows:
        table.add_row(*(_text(value) for value in row.values()))
    console = Console(highlight=False)
    # Tables wider than the terminal are not cut off.
    console.width = max(console.width, console.measure(table).maximum)
    console.print(table)


def measured_rows(
    name: str, cases: Iterable[dict[str, Any]], measure: Callable[..., dict[str, Any]]
) -> list[dict[str, Any]]:
    """One row per case: it with what `measure(**case)` returns.

    Rows are appended to <name>.jsonl there as they are measured; those that are there are read.
    """
    path = RESULTS / f"{name}.jsonl"
    path.parent.mkdir(parents=True, exist_ok=True)
    found = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    rows = []
    for case in cases:
        done = [row for row in found if row | case == row]
        if not done:
            done = [case | measure(**case)]
            with path.open("a") as file:
                file.write(json.dumps(done[0]) + "\n")
        rows.append(done[0])
    return rows


def _text(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def best_of(work: Callable[[], Any], at_least_s: float = 1.0, calls: int = 1) -> tuple[float, Any]:
    """Least processor seconds of repeated calls, and the last result.

    Called for at_least_s seconds of processor time, and at least `calls` times.
    """
    times: list[float] = []
    result = None
    while sum(times) < at_least_s or len(times) < calls:
        del result  # one result at a time is held
        start_s = time.process_time()
        result = work()
        times.append(time.process_time() - start_s)
    return min(times), result


def peak_memory_mb() -> float:
    """Peak of the resident memory in MB (2^20 bytes), as Linux keeps it in /proc."""
    # Not `ru_maxrss`: over fork and exec a process inherits that of its parent.
    status = Path("/proc/self/status").read_text()
    found = re.search(r"^VmHWM:\s*(\d+) kB", status, re.MULTILINE)
    if found is None:
        raise RuntimeError("/proc/self/status must hold VmHWM; measure on Linux")
    return int(found[1]) / 1024
