"""Tables of a finished study as Markdown, and a page whose tables are filled with them.

A page has blocks `<!-- table NAME -->` ... `<!-- end -->`; `python -m lab keep` replaces the text
between them.
"""

import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from lab.experiments.running.tables import read_table
from lab.experiments.study.fits.methods import BASELINE
from lab.experiments.study.hallway.tables.catalogue import MEASURES
from lab.experiments.study.recordings.experts import EXPERT_NAMES, PEOPLE
from serd_core.errors import SerdError
from serd_core.grid.grid import Outcome

#: The page of the study; below the root, where `python -m lab` runs.
PAGE = Path("docs/hallway_study.md")
_BLOCK = re.compile(r"(<!-- table (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
_MEASURE_TITLES = ("test", "transfer", "divergence of the dynamics")
#: Title and cells of each column; titles may repeat.
Columns = Sequence[tuple[str, "pd.Series[str]"]]


def filled(page: str, folder: Path) -> str:
    """The page with every table made from the tables of a finished study."""

    def block(match: re.Match[str]) -> str:
        name = match[2]
        if name not in TABLES:
            raise SerdError(f"table must be one of {', '.join(TABLES)}, got {name!r}")
        return f"{match[1]}\n{_markdown(TABLES[name](folder))}\n\n{match[3]}"

    return _BLOCK.sub(block, page)


def _recordings(folder: Path) -> Columns:
    table = read_table(folder / "demonstrations.csv")
    return [
        ("expert", table["expert"].map(EXPERT_NAMES)),
        ("set", table["set"]),
        ("episodes", table["episodes"]),
        ("decisions", table["decisions"]),
        ("mean time", table["mean_s"].map("{:.0f} s".format)),
        ("with flow", _percent(table["with_flow"])),
        ("against", _percent(table["against_flow"])),
        ("across", _percent(table["across_flow"])),
        ("waiting", _percent(table["waiting"])),
    ]


def _reference(folder: Path) -> Columns:
    table = read_table(folder / "reference_dynamics.csv")
    outcomes = [outcome.name.lower() for outcome in Outcome]
    return [
        ("move", table["model"].str.replace("_", " ")),
        ("decisions", table["decisions"]),
        *((name, _numbers(table[name])) for name in outcomes),
    ]


def _measures(folder: Path) -> Columns:
    table = _largest(read_table(folder / "figure_5_9.csv"))
    wide = _by_measure(table, _intervals(table, "median"), ["method"])
    return [(f"{table['size'].iloc[0]} demonstrations", wide["method"]), *_measure_columns(wide)]


def _paired(folder: Path) -> Columns:
    table = read_table(folder / "paired_tests.csv")
    cells = _intervals(table, "mean_difference") + ", p " + _p_values(table["p_holm"])
    wide = _by_measure(table, cells, ["size", "second"])
    return [
        ("demonstrations", wide["size"]),
        ("MDCE SERD minus", wide["second"]),
        *_measure_columns(wide),
    ]


def _traps(folder: Path) -> Columns:
    table = read_table(folder / "traps.csv")
    median = table["median_traps"].map("{:g}".format) + " of " + table["states"].astype(str)
    return [
        ("method", table["method"]),
        ("traps: median", median),
        ("fewest", table["fewest_traps"]),
        ("most", table["most_traps"]),
        ("policies without", _percent(table["without_traps"])),
        ("with one at a start", _percent(table["start_traps"])),
    ]


def _beliefs(folder: Path) -> Columns:
    table = _largest(read_table(folder / "beliefs.csv"))
    wide = _by_measure(table, table.apply(_mean_or_difference, axis=1), ["expert", "assumption"])
    return [
        ("the expert", wide["expert"].map(EXPERT_NAMES)),
        ("the belief is", wide["assumption"]),
        *_measure_columns(wide),
    ]


def _arrival(folder: Path) -> Columns:
    table = _of(folder / "arrival_distances.csv", people=True)
    return [
        ("method", table["method"]),
        ("arrived", _percent(table["measured_arrival"])),
        ("predicted", _percent(table["predicted_arrival"])),
        ("mean time", _seconds(table["measured_mean_s"])),
        ("predicted", _seconds(table["predicted_mean_s"])),
        ("KS", _own_intervals(table, "ks")),
        ("p", _p_values(table["ks_p_value"])),
        ("Wasserstein", _own_intervals(table, "wasserstein_s", 1) + " s"),
        ("error of arrival", _own_intervals(table, "arrival_error")),
        ("CRPS", _own_intervals(table, "crps_s", 1) + " s"),
    ]


def _scores(folder: Path) -> Columns:
    table = _of(folder / "arrival_scores.csv", people=True)
    crps, mean = (_score_columns(table, name, ["second"]) for name in ("crps_s", "measured_mean_s"))
    return [
        ("MDCE SERD minus", crps[0].index.to_series()),
        *zip(("CRPS in s", "p"), crps, strict=True),
        *zip(("measured mean time in s", "p"), mean, strict=True),
    ]


def _belief_arrival(folder: Path) -> Columns:
    table = _of(folder / "arrival_distances.csv", people=False)
    table = table.set_index(["expert", "method"], drop=False).rename_axis([None, None])
    scores = _of(folder / "arrival_scores.csv", people=False)
    # The table has the baseline minus the others.
    turned = {"mean_difference": "mean_difference", "upper": "lower", "lower": "upper"}
    scores = scores.assign(**{name: -scores[other] for name, other in turned.items()})
    crps, mean = (
        [cells.reindex(table.index, fill_value="–") for cells in columns]
        for columns in (
            _score_columns(scores, name, ["expert", "second"])
            for name in ("crps_s", "measured_mean_s")
        )
    )
    return [
        ("the expert", table["expert"].map(EXPERT_NAMES)),
        ("the belief is", table["method"]),
        ("mean time", _seconds(table["measured_mean_s"])),
        ("predicted", _seconds(table["predicted_mean_s"])),
        ("KS", _own_intervals(table, "ks")),
        *zip(("CRPS in s, minus IRL's", "p"), crps, strict=True),
        *zip(("mean time, minus IRL's", "p"), mean, strict=True),
    ]


_MAKERS: tuple[Callable[[Path], Columns], ...] = (
    _recordings, _reference, _measures, _paired, _traps, _beliefs, _arrival, _scores,
    _belief_arrival,
)  # fmt: skip
TABLES = {make.__name__.removeprefix("_"): make for make in _MAKERS}


def _markdown(columns: Columns) -> str:
    titles, cells = zip(*columns, strict=True)
    frame = pd.concat(cells, axis=1).astype(str)
    text: str = frame.to_markdown(
        index=False, headers=titles, tablefmt="github", stralign="left", disable_numparse=True
    )
    return text


def _of(path: Path, *, people: bool) -> pd.DataFrame:
    """Rows of the scripted people, or those of the planned experts."""
    table = read_table(path)
    return table[(table["expert"] == PEOPLE) == people]


def _largest(table: pd.DataFrame) -> pd.DataFrame:
    return table[table["size"] == table["size"].max()]


def _by_measure(table: pd.DataFrame, cells: pd.Series, by: list[str]) -> pd.DataFrame:
    """One column of cells per measure; one row per combination of `by`, in the table's order."""
    wide = table.assign(cell=cells).pivot(index=by, columns="measure", values="cell")
    return table[by].drop_duplicates().merge(wide.reset_index(), on=by)


def _measure_columns(wide: pd.DataFrame) -> Columns:
    return [(title, wide[name]) for title, name in zip(_MEASURE_TITLES, MEASURES, strict=True)]


def _score_columns(scores: pd.DataFrame, measure: str, by: list[str]) -> list[pd.Series]:
    """Differences with intervals, and p-values, of one score."""
    chosen = scores[scores["measure"] == measure].set_index(by).rename_axis([None] * len(by))
    return [_intervals(chosen, "mean_difference", 2), _p_values(chosen["p_holm"])]


def _mean_or_difference(row: pd.Series) -> str:
    """The baseline's mean; of others the difference to it, bold where the test rejects zero."""
    if row["assumption"] == BASELINE:
        return _number(row["mean"])
    value = _number(row["difference"])
    is_zero = value.strip("−0.") == ""
    signed = value if value.startswith("−") or is_zero else f"+{value}"
    # A difference that rounds to zero may still have one sign in every repetition.
    return f"**{signed}**" if row["p_holm"] < 0.05 and not is_zero else signed


def _own_intervals(table: pd.DataFrame, name: str, digits: int = 3) -> pd.Series:
    """As `_intervals`, of a number whose limits are in columns with its name."""
    return _intervals(table, name, digits, f"{name}_lower", f"{name}_upper")


def _intervals(
    table: pd.DataFrame, name: str, digits: int = 3, lower: str = "lower", upper: str = "upper"
) -> pd.Series:
    """`value (lower to upper)`; the value alone where it is infinite."""
    text = table[[name, lower, upper]].map(partial(_number, digits=digits))
    both = text[name] + " (" + text[lower] + " to " + text[upper] + ")"
    return both.where(np.isfinite(table[name]), text[name])


def _numbers(values: pd.Series) -> pd.Series:
    return values.map(_number)


def _seconds(values: pd.Series) -> pd.Series:
    return values.map(partial(_number, digits=1)) + " s"


def _percent(values: pd.Series) -> pd.Series:
    return values.map(lambda share: f"{100 * share:.1f} %")


def _p_values(values: pd.Series) -> pd.Series:
    text = values.map("{:.3f}".format).mask(values < 0.001, "< 0.001")
    return text.mask(values.isna(), "–")


def _number(value: float, digits: int = 3) -> str:
    """A number with a typographic minus, and no minus before a zero."""
    rounded = round(float(value), digits) + 0.0
    return f"{rounded:.{digits}f}".replace("-", "−").replace("inf", "∞")
