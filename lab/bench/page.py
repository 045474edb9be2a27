"""The page of the table: what joint estimation adds, and every method on every task."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path

import numpy as np
import pandas as pd
import scipy.stats

from lab.bench.measure import METHODS
from lab.bench.tasks import TASKS
from lab.experiments.running.tables import Row
from serd_core.arrays import FloatArray

OURS, SAME_PRIOR = "serd", "irl_same_prior"
#: Columns of scores, and whether more is better; coverage has no direction.
SCORES = {"log-likelihood": 1, "transfer": 1, "divergence": -1}
COVERAGES = ("coverage of weights", "coverage of probabilities")
MEASURED = (*SCORES, *COVERAGES, "weights without interval")
#: Of a difference in pairs.
LEVEL = 0.05
#: Its text up to the first picture is written by hand, and stays.
PAGE = Path(__file__).resolve().parents[2] / "docs" / "bench.md"
#: Of a task, its methods.
Rows = Mapping[str, Mapping[str, Sequence[Row]]]


def table_of(rows: Rows) -> pd.DataFrame:
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
    parts = ("", " ±", ": SERD better by", ": SERD better by ±", ": against SERD")
    order = ["task", "demonstrations", "method", "seeds"]
    order += [f"{name}{part}" for name in MEASURED for part in parts] + ["warm_s", "cold_s"]
    return table[[name for name in order if name in table]]


def summary(rows: Sequence[Row], ours: Mapping[int, Row]) -> Row:
    """Means and differences from SERD, with half widths of their intervals and a direction."""
    found: Row = {"seeds": len(rows)}
    for name in MEASURED:
        values = np.array([row[name] for row in rows if name in row])
        if not len(values):
            continue
        found |= {name: float(values.mean()), f"{name} ±": half_width(values)}
        pairs = [
            (row[name], ours[row["seed"]][name])
            for row in rows
            if name in row and name in ours.get(row["seed"], {})
        ]
        if name in SCORES and pairs:
            gains: FloatArray = SCORES[name] * -np.diff(pairs)[:, 0]
            found[f"{name}: SERD better by"] = -float(gains.mean())
            found[f"{name}: SERD better by ±"] = half_width(gains)
            found[f"{name}: against SERD"] = direction(gains)
    found["warm_s"] = float(np.median([row["warm_s"] for row in rows]))
    cold = [row["cold_s"] for row in rows if "cold_s" in row]
    return found | ({"cold_s": float(np.median(cold))} if cold else {})


def half_width(values: FloatArray) -> float:
    """Of a 95 % interval of the mean by Student's t."""
    if len(values) < 2:
        return float("nan")
    return float(scipy.stats.t.ppf(0.975, len(values) - 1) * scipy.stats.sem(values))


def direction(gains: FloatArray) -> int:
    """1 where differences are above 0 in a signed-rank test, -1 where they are below, or 0."""
    if not np.any(gains) or scipy.stats.wilcoxon(gains).pvalue >= LEVEL:
        return 0
    return 1 if np.median(gains) > 0 else -1


def page(rows: Rows, absent: Mapping[str, str], folder: str) -> str:
    """The document; absent: why tasks and methods are not measured, by name.

    folder: of bench.csv and bench.png, from that of the page, with its slash.
    """
    table = table_of(rows)
    parts = [
        [PAGE.read_text(encoding="utf-8").partition("\n![")[0]],
        [f"![every method on every task, means with intervals]({folder}bench.png)", ""],
        [f"All numbers, with intervals: [bench.csv]({folder}bench.csv).", ""],
        ["## What joint estimation adds", "", *_gains(table), ""],
        ["## Methods", "", *_by_method(table), ""],
        [f"- *{name}* is not measured: {why}." for name, why in absent.items()],
        list(_refusals(rows)),
        list(_failures(rows)),
    ]
    return "\n".join(chain(*parts)).rstrip() + "\n"


def _lines(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    return [" | ".join(heads), "|".join(["---"] * len(heads)), *map(" | ".join, rows)]


def _gains(table: pd.DataFrame) -> list[str]:
    """SERD less IRL under the same prior, per task and size, and the coverage of both."""
    ours, other = (table[table["method"] == METHODS[name].title] for name in (OURS, SAME_PRIOR))
    pairs = ours.merge(other, on=["task", "demonstrations"], suffixes=(" of SERD", ""), sort=False)
    heads = [f"{name}, SERD better by" for name in SCORES]
    heads += [f"{name}: SERD, IRL" for name in COVERAGES]
    rows = [
        [f"{row['task']}, {row['demonstrations']}"]
        + [_cell(row, f"{n}: SERD better by", -row.get(f"{n}: against SERD", 0)) for n in SCORES]
        + [f"{_number(row.get(f'{n} of SERD'))}, {_number(row.get(n))}" for n in COVERAGES]
        for row in pairs.to_dict("records")
    ]
    return _lines(["task, demonstrations", *heads], rows)


def _by_method(table: pd.DataFrame) -> list[str]:
    """In how many cells a method is better and worse than SERD, mean coverage, median times."""
    rows = []
    for title, here in table.groupby("method", sort=False):
        row = [str(title)]
        for name in SCORES:
            marks = here.get(f"{name}: against SERD", pd.Series(dtype=float)).dropna()
            counts = f"{(marks > 0).sum()}, {(marks < 0).sum()} of {len(marks)}"
            row.append(counts if len(marks) else "–")
        row += [_number(here[name].mean() if name in here else None) for name in COVERAGES]
        rows.append(row + [_number(here[name].median()) for name in ("warm_s", "cold_s")])
    heads = [f"{name}: better, worse than SERD" for name in SCORES]
    return _lines(["method", *heads, *COVERAGES, "s, warm", "s, cold"], rows)


def _refusals(rows: Rows) -> Iterator[str]:
    """Which tasks methods do not state, by what they state only."""
    tasks = dict[tuple[str, str], list[str]]()
    for task, by_method in rows.items():
        for method, every in by_method.items():
            for reason in {row["refused"]: None for row in every if "refused" in row}:
                tasks.setdefault((task, reason), []).append(METHODS[method].title)
    for (task, reason), titles in tasks.items():
        yield f"- Not run on {task}: {'; '.join(titles)}, which can state {reason} only."


def _failures(rows: Rows) -> Iterator[str]:
    for task, by_method in rows.items():
        for method, every in by_method.items():
            failed = [row["failed"] for row in every if "failed" in row]
            if failed:
                title, share = METHODS[method].title, f"{len(failed)} of {len(every)}"
                yield f"- {title} failed in {share} cases of *{task}*: {failed[0]}"


def _cell(row: Row, name: str, mark: float) -> str:
    """Number and half width, to two digits of the latter."""
    value, half = row.get(name), row.get(f"{name} ±")
    if value is None or np.isnan(value):
        return "–"
    digits, width = 3, ""
    if half is not None and 0.0 < half < 1.0:
        digits = 1 - int(np.floor(np.log10(half)))
        width = f"±{half:.{digits}f}"
    sign = "▲" if mark > 0 else "▼" if mark < 0 else ""
    return f"{value:.{digits}f}{width}{sign}".replace("-", "−")


def _number(value: float | None) -> str:
    return "–" if value is None or np.isnan(value) else f"{value:#.2g}".rstrip(".")
