"""The study's tables as Markdown, and a page whose tables are filled from a finished study.

A page has blocks `<!-- table NAME -->` ... `<!-- end -->`; what stands between is written anew:

    python -m experiments.study.markdown docs/hallway_study.md
"""

import re
import sys
from collections.abc import Callable
from pathlib import Path

from experiments.study.kept_tables import read_table
from experiments.study.markdown_cells import (
    around,
    difference,
    number,
    p_value,
    percent,
    table_text,
    with_range,
)
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
    rows = read_table(folder, "demonstrations")
    header = ["expert", "set", "episodes", "decisions", "mean time", "with flow", "against"]
    header += ["across", "waiting"]
    models = ("with_flow", "against_flow", "across_flow", "waiting")
    return table_text(
        header,
        (
            [
                _EXPERTS[row["expert"]],
                row["set"],
                row["episodes"],
                row["decisions"],
                f"{float(row['mean_s']):.0f} s",
                *(percent(row[model]) for model in models),
            ]
            for row in rows
        ),
    )


def _reference(folder: Path) -> str:
    outcomes = ("stay", "forward", "right", "back", "left")
    return table_text(
        ["move", "decisions", *outcomes],
        (
            [row["model"].replace("_", " "), row["decisions"], *(number(row[o]) for o in outcomes)]
            for row in read_table(folder, "reference_dynamics")
        ),
    )


def _measures(folder: Path) -> str:
    rows = read_table(folder, "figure_5_9")
    largest = max(int(row["size"]) for row in rows)
    methods = list(dict.fromkeys(row["method"] for row in rows))
    table = []
    for method in methods:
        found = {
            row["measure"]: row
            for row in rows
            if row["method"] == method and int(row["size"]) == largest
        }
        table.append([method, *(with_range(found[measure], "median") for measure in _MEASURES)])
    header = [f"{largest} demonstrations", "test", "transfer", "divergence of the dynamics"]
    return table_text(header, table)


def _paired(folder: Path) -> str:
    rows = read_table(folder, "paired_tests")
    table = []
    for size in sorted({int(row["size"]) for row in rows}):
        for method in dict.fromkeys(row["second"] for row in rows):
            found = {
                row["measure"]: row
                for row in rows
                if row["second"] == method and int(row["size"]) == size
            }
            cells = (
                f"{with_range(found[measure], 'mean_difference')}, p {p_value(found[measure])}"
                for measure in _MEASURES
            )
            table.append([str(size), method, *cells])
    header = ["demonstrations", "MDCE SERD minus", "test", "transfer", "divergence of the dynamics"]
    return table_text(header, table)


def _arrival(folder: Path) -> str:
    rows = [row for row in read_table(folder, "arrival_distances") if row["expert"] == "people"]
    header = ["method", "arrived", "predicted", "mean time", "predicted", "KS", "p"]
    header += ["Wasserstein", "error of arrival", "CRPS"]
    return table_text(
        header,
        (
            [
                row["method"],
                percent(row["measured_arrival"]),
                percent(row["predicted_arrival"]),
                f"{float(row['measured_mean_s']):.1f} s",
                f"{float(row['predicted_mean_s']):.1f} s",
                around(row, "ks"),
                p_value({"p_holm": row["ks_p_value"]}),
                f"{around(row, 'wasserstein_s', 1)} s",
                around(row, "arrival_error"),
                f"{around(row, 'crps_s', 1)} s",
            ]
            for row in rows
        ),
    )


def _scores(folder: Path) -> str:
    rows = [row for row in read_table(folder, "arrival_scores") if row["expert"] == "people"]
    return table_text(
        ["MDCE SERD minus", "difference of the CRPS in s", "p"],
        ([row["second"], with_range(row, "crps_difference_s", 2), p_value(row)] for row in rows),
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
    return table_text(
        header,
        (
            [
                row["method"],
                f"{float(row['median_traps']):g} of {row['states']}",
                row["fewest_traps"],
                row["most_traps"],
                percent(row["without_traps"]),
                percent(row["start_traps"]),
            ]
            for row in read_table(folder, "traps")
        ),
    )


def _beliefs(folder: Path) -> str:
    rows = read_table(folder, "beliefs")
    arrivals = {
        (row["expert"], row["method"]): row for row in read_table(folder, "arrival_distances")
    }
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
                    *(difference(found[measure]) for measure in _MEASURES),
                    f"{float(arrival['measured_mean_s']):.1f} s",
                    f"{float(arrival['predicted_mean_s']):.1f} s",
                ]
            )
    header = ["the expert", "the belief is", "test", "transfer", "divergence of the dynamics"]
    return table_text([*header, "mean time", "predicted"], table)


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


if __name__ == "__main__":
    for name in sys.argv[1:]:
        atomic_write_text(name, filled(read_text(name), KEPT))
