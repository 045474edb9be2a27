"""Times of arrival as Markdown tables, made from the CSV files of a finished study."""

from collections.abc import Callable, Sequence
from pathlib import Path

from experiments.running.repetitions import Row
from experiments.study.page.cells import (
    EXPERT_NAMES,
    around,
    number,
    p_value,
    percent,
    seconds,
    table_text,
    with_range,
)
from experiments.study.tables.kept_tables import read_table

_PEOPLE = "people"


def _arrival(folder: Path) -> str:
    header = ["method", "arrived", "predicted", "mean time", "predicted", "KS", "p"]
    header += ["Wasserstein", "error of arrival", "CRPS"]
    return table_text(
        header,
        (
            [
                row["method"],
                percent(row["measured_arrival"]),
                percent(row["predicted_arrival"]),
                seconds(row["measured_mean_s"]),
                seconds(row["predicted_mean_s"]),
                around(row, "ks"),
                _ks_p(row, "ks_p_value"),
                f"{around(row, 'wasserstein_s', 1)} s",
                around(row, "arrival_error"),
                f"{around(row, 'crps_s', 1)} s",
            ]
            for row in _rows(folder, "arrival_distances")
        ),
    )


def _scores(folder: Path) -> str:
    rows = _rows(folder, "arrival_scores")
    found = {(row["measure"], row["second"]): row for row in rows}
    return table_text(
        ["MDCE SERD minus", "CRPS in s", "p", "measured mean time in s", "p"],
        ([method, *_scored(found, method)] for method in dict.fromkeys(r["second"] for r in rows)),
    )


def _hindsight(folder: Path) -> str:
    kinds = ("learned", "pooled", "hindsight")
    header = ["the expert", "method", "measured", "predicted as learned", "pooled", "in hindsight"]
    header += ["KS as learned", "pooled", "in hindsight", "p of the last"]
    header += ["standing still with the flow, as learned", "pooled", "in hindsight"]
    return table_text(
        header,
        (
            [
                EXPERT_NAMES[row["expert"]],
                row["method"],
                seconds(row["learned_measured_mean_s"]),
                *(seconds(row[f"{kind}_predicted_mean_s"]) for kind in kinds),
                *(number(row[f"{kind}_ks"]) for kind in kinds),
                _ks_p(row, "hindsight_ks_p_value"),
                *(percent(row[f"{kind}_stay_with_flow"]) for kind in kinds),
            ]
            for row in read_table(folder, "arrival_hindsight")
            if row["hindsight_ks"]
        ),
    )


def _belief_arrival(folder: Path) -> str:
    scores = [row for row in read_table(folder, "arrival_scores") if row["expert"] != _PEOPLE]
    table = []
    for row in read_table(folder, "arrival_distances"):
        if row["expert"] == _PEOPLE:
            continue
        found = {
            (score["measure"], score["second"]): _turned(score)
            for score in scores
            if score["expert"] == row["expert"]
        }
        table.append(
            [
                EXPERT_NAMES[row["expert"]],
                row["method"],
                seconds(row["measured_mean_s"]),
                seconds(row["predicted_mean_s"]),
                around(row, "ks"),
                *_scored(found, row["method"]),
            ]
        )
    header = ["the expert", "the belief is", "mean time", "predicted", "KS"]
    return table_text(
        [*header, "CRPS in s, minus IRL's", "p", "mean time, minus IRL's", "p"], table
    )


def _scored(found: dict[tuple[str, str], Row], method: str) -> Sequence[str]:
    """Difference and p-value of both scores; dashes for what all others are compared with."""
    cells: list[str] = []
    for measure in ("crps_s", "measured_mean_s"):
        row = found.get((measure, method))
        cells += (
            ["–", "–"] if row is None else [with_range(row, "mean_difference", 2), p_value(row)]
        )
    return cells


def _turned(row: Row) -> Row:
    """Second minus first, where the table has first minus second."""
    names = ("mean_difference", "lower", "upper")
    value, lower, upper = (str(-float(row[name])) for name in names)
    return row | dict(zip(names, (value, upper, lower), strict=True))


def _rows(folder: Path, table: str) -> list[Row]:
    return [row for row in read_table(folder, table) if row["expert"] == _PEOPLE]


def _ks_p(row: Row, name: str) -> str:
    return p_value({"p_holm": row[name]})


ARRIVAL_TABLES: dict[str, Callable[[Path], str]] = {
    "arrival": _arrival,
    "scores": _scores,
    "hindsight": _hindsight,
    "belief_arrival": _belief_arrival,
}
