"""The page of the table: means over seeds with 95 % intervals, and what is better than SERD."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import scipy.stats

from lab.bench.measure import METHODS
from lab.bench.tasks import TASKS
from lab.experiments.running.tables import Row

OURS = "serd"
#: Columns of scores, and whether more is better; coverage has no direction.
SCORES = {"log-likelihood": 1, "transfer": 1, "divergence": -1}
COVERAGES = ("coverage of weights", "coverage of probabilities")
#: Of a difference in pairs.
LEVEL = 0.05
INTRODUCTION = Path(__file__).parent / "introduction.md"


def table_of(rows: Mapping[str, Mapping[str, Sequence[Row]]]) -> pd.DataFrame:
    """One row per task, size and method that has results; rows: by task and method."""
    found = []
    for task, by_method in rows.items():
        for size in TASKS[task].sizes:
            ours = {row["seed"]: row for row in by_method.get(OURS, ()) if row["size"] == size}
            for method, every in by_method.items():
                here = [row for row in every if row["size"] == size and "warm_s" in row]
                if here:
                    place = {"task": task, "demonstrations": size, "method": METHODS[method].title}
                    found.append(place | summary(here, {} if method == OURS else ours))
    table = pd.DataFrame(found)
    first = [
        f"{name}{part}" for name in (*SCORES, *COVERAGES) for part in ("", " ±", " against SERD")
    ]
    order = ["task", "demonstrations", "method", "seeds", *first, "warm_s", "cold_s"]
    return table[[name for name in order if name in table]]


def summary(rows: Sequence[Row], ours: Mapping[int, Row]) -> Row:
    """Means, half widths of their intervals, and the direction of significant differences."""
    found: Row = {"seeds": len(rows)}
    for name in (*SCORES, *COVERAGES):
        values = np.array([row[name] for row in rows if name in row])
        if not len(values):
            continue
        found[name] = float(values.mean())
        found[f"{name} ±"] = half_width(values)
        pairs = [
            (row[name], ours[row["seed"]][name])
            for row in rows
            if name in row and name in ours.get(row["seed"], {})
        ]
        if name in SCORES and pairs:
            found[f"{name} against SERD"] = direction(np.array(pairs), SCORES[name])
    found["warm_s"] = float(np.median([row["warm_s"] for row in rows]))
    cold = [row["cold_s"] for row in rows if "cold_s" in row]
    return found | ({"cold_s": float(np.median(cold))} if cold else {})


def half_width(values: np.ndarray) -> float:
    """Of a 95 % interval of the mean by Student's t."""
    if len(values) < 2:
        return float("nan")
    return float(scipy.stats.t.ppf(0.975, len(values) - 1) * scipy.stats.sem(values))


def direction(pairs: np.ndarray, sign: int) -> int:
    """1 where the first of (n, 2) pairs are better in a signed-rank test, -1 where worse, or 0."""
    gain = sign * (pairs[:, 0] - pairs[:, 1])
    if not np.any(gain) or scipy.stats.wilcoxon(gain).pvalue >= LEVEL:
        return 0
    return 1 if np.median(gain) > 0 else -1


def page(rows: Mapping[str, Mapping[str, Sequence[Row]]], absent: Mapping[str, str]) -> str:
    """The document; absent: why tasks and methods have not been measured, by name."""
    table = table_of(rows)
    parts = [INTRODUCTION.read_text()]
    for name, task in TASKS.items():
        parts.append(f"## {name}: {task.about}\n")
        here = table[table["task"] == name] if len(table) else table
        parts += list(_lines(here)) if len(here) else []
        parts += [f"{text}\n" for text in _remarks(name, rows.get(name, {}), absent)]
    return "\n".join(parts).rstrip() + "\n"


def _lines(table: pd.DataFrame) -> Iterator[str]:
    shown = [name for name in (*SCORES, *COVERAGES) if name in table and table[name].notna().any()]
    heads = ["demonstrations", "method", "seeds", *shown, "s, warm", "s, cold"]
    yield "\n".join([f"| {' | '.join(heads)} |", "|" + " --- |" * len(heads)])
    for row in table.to_dict("records"):
        cells = [str(row["demonstrations"]), row["method"], str(row["seeds"])]
        cells += [_cell(row, name) for name in shown]
        cells += [_number(row.get(name)) for name in ("warm_s", "cold_s")]
        yield f"| {' | '.join(cells)} |"
    yield ""


def _cell(row: Row, name: str) -> str:
    value, half = row.get(name), row.get(f"{name} ±")
    if value is None or np.isnan(value):
        return "–"
    mark = {1: " ▲", -1: " ▼"}.get(row.get(f"{name} against SERD", 0), "")
    width = "" if half is None or np.isnan(half) else f" ± {half:.2g}"
    return f"{value:.3f}{width}{mark}".replace("-", "−")


def _number(value: float | None) -> str:
    return "–" if value is None or np.isnan(value) else f"{value:.2g}"


def _remarks(
    task: str, rows: Mapping[str, Sequence[Row]], absent: Mapping[str, str]
) -> Iterator[str]:
    """Why there is no row, or how many cases failed."""
    if task in absent:
        yield f"Not measured: {absent[task]}."
        return
    for method, every in rows.items():
        title = METHODS[method].title
        refused = [row["refused"] for row in every if "refused" in row]
        failed = [row["failed"] for row in every if "failed" in row]
        if refused:
            yield f"{title}: states {refused[0]} only."
        if failed:
            yield f"{title}: failed in {len(failed)} of {len(every)} cases ({failed[0]})."
    for method, reason in absent.items():
        if method in METHODS and not rows.get(method):
            yield f"{METHODS[method].title}: {reason}."
