"""The study's tables as Markdown, and a page whose tables are filled from a finished study.

A page has blocks `<!-- table NAME -->` ... `<!-- end -->`; what stands between is written anew:

    python -m experiments.study.markdown docs/hallway_study.md
"""

import csv
import io
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from experiments.repetitions import Row
from experiments.study.run import KEPT
from serd_core.errors import SerdError
from storage.atomic import atomic_write_text
from storage.text_file import read_text

_BLOCK = re.compile(r"(<!-- table (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
_EXPERTS = {
    "people": "scripted people",
    "knows": "knows the crowd",
    "ignores_crowd": "ignores the crowd",
    "fears_crowd": "fears the crowd",
}
_MEASURES = ("test_log_likelihood", "transfer_log_likelihood", "dynamics_divergence")


def filled(page: str, folder: Path) -> str:
    """The page with every table made from the tables of a finished study."""

    def block(match: re.Match[str]) -> str:
        name = match[2]
        if name not in TABLES:
            raise SerdError(f"table must be one of {', '.join(TABLES)}, got {name!r}")
        return f"{match[1]}\n{TABLES[name](folder)}\n{match[3]}"

    return _BLOCK.sub(block, page)


def _recordings(folder: Path) -> str:
    rows = _read(folder, "demonstrations")
    header = ["expert", "set", "episodes", "decisions", "mean time", "with flow", "against"]
    header += ["across", "waiting"]
    models = ("with_flow", "against_flow", "across_flow", "waiting")
    return _table(
        header,
        (
            [
                _EXPERTS[row["expert"]],
                row["set"],
                row["episodes"],
                row["decisions"],
                f"{float(row['mean_s']):.0f} s",
                *(_percent(row[model]) for model in models),
            ]
            for row in rows
        ),
    )


def _reference(folder: Path) -> str:
    outcomes = ("stay", "forward", "right", "back", "left")
    return _table(
        ["move", "decisions", *outcomes],
        (
            [row["model"].replace("_", " "), row["decisions"], *(_number(row[o]) for o in outcomes)]
            for row in _read(folder, "reference_dynamics")
        ),
    )


def _measures(folder: Path) -> str:
    rows = _read(folder, "figure_5_9")
    largest = max(int(row["size"]) for row in rows)
    methods = list(dict.fromkeys(row["method"] for row in rows))
    table = []
    for method in methods:
        found = {
            row["measure"]: row
            for row in rows
            if row["method"] == method and int(row["size"]) == largest
        }
        table.append([method, *(_with_range(found[measure], "median") for measure in _MEASURES)])
    header = [f"{largest} demonstrations", "test", "transfer", "divergence of the dynamics"]
    return _table(header, table)


def _paired(folder: Path) -> str:
    rows = _read(folder, "paired_tests")
    table = []
    for size in sorted({int(row["size"]) for row in rows}):
        for method in dict.fromkeys(row["second"] for row in rows):
            found = {
                row["measure"]: row
                for row in rows
                if row["second"] == method and int(row["size"]) == size
            }
            cells = (
                f"{_with_range(found[measure], 'mean_difference')}, p {_p(found[measure])}"
                for measure in _MEASURES
            )
            table.append([str(size), method, *cells])
    header = ["demonstrations", "MDCE SERD minus", "test", "transfer", "divergence of the dynamics"]
    return _table(header, table)


def _arrival(folder: Path) -> str:
    rows = [row for row in _read(folder, "arrival_distances") if row["expert"] == "people"]
    header = ["method", "arrived", "predicted", "mean time", "predicted", "KS", "p"]
    header += ["Wasserstein", "error of arrival", "CRPS"]
    return _table(
        header,
        (
            [
                row["method"],
                _percent(row["measured_arrival"]),
                _percent(row["predicted_arrival"]),
                f"{float(row['measured_mean_s']):.1f} s",
                f"{float(row['predicted_mean_s']):.1f} s",
                _around(row, "ks"),
                _p({"p_holm": row["ks_p_value"]}),
                f"{_around(row, 'wasserstein_s', 1)} s",
                _around(row, "arrival_error"),
                f"{_around(row, 'crps_s', 1)} s",
            ]
            for row in rows
        ),
    )


def _scores(folder: Path) -> str:
    rows = [row for row in _read(folder, "arrival_scores") if row["expert"] == "people"]
    return _table(
        ["MDCE SERD minus", "difference of the CRPS in s", "p"],
        ([row["second"], _with_range(row, "crps_difference_s", 2), _p(row)] for row in rows),
    )


def _traps(folder: Path) -> str:
    header = [
        "method",
        "traps: median",
        "fewest",
        "most",
        "policies without",
        "with one at a start",
    ]
    return _table(
        header,
        (
            [
                row["method"],
                f"{float(row['median_traps']):g} of {row['states']}",
                row["fewest_traps"],
                row["most_traps"],
                _percent(row["without_traps"]),
                _percent(row["start_traps"]),
            ]
            for row in _read(folder, "traps")
        ),
    )


def _beliefs(folder: Path) -> str:
    rows = _read(folder, "beliefs")
    arrivals = {(row["expert"], row["method"]): row for row in _read(folder, "arrival_distances")}
    largest = max(int(row["size"]) for row in rows)
    table = []
    for expert in dict.fromkeys(row["expert"] for row in rows):
        for assumption in dict.fromkeys(row["assumption"] for row in rows):
            found = {
                row["measure"]: row
                for row in rows
                if (row["expert"], row["assumption"], int(row["size"]))
                == (expert, assumption, largest)
            }
            arrival = arrivals[expert, assumption]
            table.append(
                [
                    _EXPERTS[expert],
                    assumption,
                    *(_difference(found[measure]) for measure in _MEASURES),
                    f"{float(arrival['measured_mean_s']):.1f} s",
                    f"{float(arrival['predicted_mean_s']):.1f} s",
                ]
            )
    header = ["the expert", "the belief is", "test", "transfer", "divergence of the dynamics"]
    return _table([*header, "mean time", "predicted"], table)


TABLES: dict[str, Callable[[Path], str]] = {
    "recordings": _recordings,
    "reference": _reference,
    "measures": _measures,
    "paired": _paired,
    "arrival": _arrival,
    "scores": _scores,
    "traps": _traps,
    "beliefs": _beliefs,
}


def _read(folder: Path, name: str) -> list[Row]:
    return list(csv.DictReader(io.StringIO(read_text(folder / f"{name}.csv"))))


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [list(header), ["---"] * len(header), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _number(value: str, digits: int = 3) -> str:
    return f"{float(value):.{digits}f}".replace("-", "−")


def _with_range(row: Row, name: str, digits: int = 3) -> str:
    """`middle (lower to upper)` of a row with those columns."""
    low, high = _number(row["lower"], digits), _number(row["upper"], digits)
    return f"{_number(row[name], digits)} ({low} to {high})"


def _around(row: Row, name: str, digits: int = 3) -> str:
    low, high = (_number(row[f"{name}_{end}"], digits) for end in ("lower", "upper"))
    return f"{_number(row[name], digits)} ({low} to {high})"


def _difference(row: Row) -> str:
    """The mean; for all but the baseline the difference to it, bold where the test finds one."""
    mean = _number(row["mean"])
    if not row["p_holm"]:
        return mean
    difference = f"{float(row['difference']):+.3f}".replace("-", "−")
    return f"**{difference}**" if float(row["p_holm"]) < 0.05 else difference


def _percent(value: str) -> str:
    return f"{100 * float(value):.1f} %"


def _p(row: Row) -> str:
    value = float(row["p_holm"])
    return "< 0.001" if value < 0.001 else f"{value:.3f}"


if __name__ == "__main__":
    for name in sys.argv[1:]:
        atomic_write_text(name, filled(read_text(name), KEPT))
