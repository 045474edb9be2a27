"""What was recorded and learned, as Markdown tables made from the CSV files of a finished study."""

from collections.abc import Callable
from pathlib import Path

from experiments.study.page.cells import (
    EXPERT_NAMES,
    difference,
    number,
    p_value,
    percent,
    table_text,
    with_range,
)
from experiments.study.tables.kept_tables import read_table

_MEASURES = ("test_log_likelihood", "transfer_log_likelihood", "dynamics_divergence")


def _recordings(folder: Path) -> str:
    rows = read_table(folder, "demonstrations")
    header = ["expert", "set", "episodes", "decisions", "mean time", "with flow", "against"]
    header += ["across", "waiting"]
    models = ("with_flow", "against_flow", "across_flow", "waiting")
    return table_text(
        header,
        (
            [
                EXPERT_NAMES[row["expert"]],
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
            table.append(
                [
                    EXPERT_NAMES[expert],
                    assumption,
                    *(difference(found[measure]) for measure in _MEASURES),
                ]
            )
    header = ["the expert", "the belief is", "test", "transfer", "divergence of the dynamics"]
    return table_text(header, table)


LEARNING_TABLES: dict[str, Callable[[Path], str]] = {
    "recordings": _recordings,
    "reference": _reference,
    "measures": _measures,
    "paired": _paired,
    "traps": _traps,
    "beliefs": _beliefs,
}
