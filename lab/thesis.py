"""The numbers in the table of docs/thesis.md, computed from the tables that the documents keep.

`python -m lab keep` writes them; the other cells are written by hand.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd

from serd_bag.files import read_text

#: Below the root, as `lab.RESULTS`; the second has tables between `<!-- table NAME -->` and an end.
PAGE, HALLWAY_PAGE = Path("docs/thesis.md"), Path("docs/hallway_study.md")


def _modes(table: pd.DataFrame) -> str:
    count = table.groupby(["learner", "mode"])["n"].sum().astype(int)
    return (
        f"SERD {count['MDCE SERD', 'A']} A, {count['MDCE SERD', 'B']} B;"
        f" IRL {count['MDCE IRL', 'A']} A, {count['MDCE IRL', 'B']} B"
    )


def _certainty(table: pd.DataFrame) -> str:
    largest = table[table["size"] == table["size"].max()]
    medians = largest.set_index(["learner", "mode"])["median"]
    serd = ", ".join(f"{medians['MDCE SERD', mode]:.1e} in {mode}" for mode in "AB")
    irl = f"{medians['MDCE IRL', 'B']:.1e} in B"
    return f"SERD {serd}; IRL {irl}"


def _exponents(table: pd.DataFrame) -> str:
    fitted = table.set_index(["method", "varied"])["fitted"]
    return "; ".join(
        f"{method} "
        + ", ".join(
            f"{fitted[method, f'n_{of}']:.1f}" for of in ("states", "actions", "parameters")
        )
        for method in ("LU", "soft step", "hard step")
    )


def _distributions(table: pd.DataFrame) -> str:
    found = table.dropna().groupby("prior", sort=False)["p_1"]
    shares = {prior: sorted({f"{value:.2f}" for value in values}) for prior, values in found}
    parts = (f"{prior} {' or '.join(texts)}" for prior, texts in shares.items())
    return f"p₁: {'; '.join(parts)}".replace("|", r"\|")


def _gridworld(learners: Sequence[str], **measures: str) -> Callable[[pd.DataFrame], str]:
    """Medians of the learners at 12 demonstrations; measures: their words by the table's names."""

    def number(table: pd.DataFrame) -> str:
        parts = []
        for name, words in measures.items():
            rows = table[(table["size"] == _SIZE) & (table["measure"] == name)]
            medians = rows.set_index("learner")["median"]
            shown = (f"{medians[learner]:.3f}" for learner in learners)
            parts.append(f"{words} {', '.join(shown)}")
        return "; ".join(parts)

    return number


_SIZE = 12
_MDCE = ("MDCE SERD", "MDCE IRL", "REIRL")
_PM = ("PM SERD, regularised", "PM SERD", "MDCE IRL", "REIRL")


def _hallway(*measures: str) -> Callable[[pd.DataFrame], str]:
    """Medians of the last size; measures: with their words, as "test_log_likelihood test"."""

    def number(table: pd.DataFrame) -> str:
        largest = table[table["size"] == table["size"].max()]
        parts = []
        for measure in measures:
            name, words = measure.split(" ", 1)
            medians = largest[largest["measure"] == name].set_index("method")["median"]
            shown = (f"{medians[each]:.3f}" for each in _HALLWAY_METHODS)
            parts.append(f"{words} {', '.join(shown)}")
        return "; ".join(parts)

    return number


_HALLWAY_METHODS = ("MDCE SERD", "MDCE IRL, likelihood", "REIRL")


def _ascents(table: pd.DataFrame) -> str:
    by_name = table.set_index("ascent")
    lost = by_name["objective"].max() - by_name.loc["gradient", "objective"]
    return (
        f"{lost:.2f} below the maximum after {by_name.loc['gradient', 'n_steps']} steps;"
        f" trust region {by_name.loc['trust-region', 'n_steps']}"
    )


def _arrivals(table: pd.DataFrame) -> str:
    """Titles of the page's table: method, arrived, mean time, predicted, trap states."""
    means = table.set_index(0)
    shown = (f"{means.loc[name, 2]}, {means.loc[name, 3]}" for name in _HALLWAY_METHODS)
    return f"measured, predicted s: {'; '.join(shown)}"


def _traps(table: pd.DataFrame) -> str:
    medians = table.set_index(0)[4]
    return f"{', '.join(medians[name] for name in _HALLWAY_METHODS)} of 176"


#: By the first cell of a row: the kept table, or one of the hallway's page, and its number.
NUMBERS: dict[str, tuple[str, Callable[[pd.DataFrame], str]]] = {
    "Algorithm 1, line 9": ("ascents", _ascents),
    "Table 4.2": ("policy-cost", _exponents),
    "Fig. 4.6, Table 4.3": ("priors", _distributions),
    "Fig. 4.8": ("minimum-example", _modes),
    "Fig. 4.9": ("minimum-example", _certainty),
    "Fig. 4.12 a": ("gridworld", _gridworld(_MDCE, log_likelihood="log-likelihood")),
    "Fig. 4.12 b, c, d": (
        "gridworld",
        _gridworld(
            _MDCE,
            dynamics_divergence="dynamics",
            policy_divergence="policy",
            transfer_log_likelihood="transfer",
        ),
    ),
    "Fig. 4.13": (
        "gridworld-pm",
        _gridworld(_PM, log_likelihood="log-likelihood", dynamics_divergence="dynamics"),
    ),
    "Fig. 5.9 a, b": (
        "hallway",
        _hallway("test_log_likelihood test", "transfer_log_likelihood transfer"),
    ),
    "Fig. 5.9 c": ("hallway", _hallway("dynamics_divergence divergence")),
    "Fig. 5.10": ("arrival", _arrivals),
    "Fig. 5.11": ("arrival", _traps),
}


def filled(page: str, documents: Path) -> str:
    """The page with the numbers of the kept tables in a folder."""
    return "".join(_with_number(line, documents) for line in page.splitlines(keepends=True))


def rows_of(page: str) -> list[list[str]]:
    """Cells of the page's rows: item, what it shows, command, number here, difference."""
    lines = page.splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("---|"))
    return [_cells(line) for line in lines[first + 1 :] if " | " in line]


def _cells(line: str) -> list[str]:
    return line.strip().split(" | ")


def _with_number(line: str, documents: Path) -> str:
    item, *others = _cells(line)
    if item not in NUMBERS:
        return line
    name, number_of = NUMBERS[item]
    table, link = _table(name, documents)
    number = f"{number_of(table)} ([{name}]({link}))"
    number = number.replace("-0.", "−0.").replace("-1.", "−1.").replace(" -", " −")
    shows, command, _, differs = others
    return f"{' | '.join([item, shows, command, number, differs])}\n"


def _table(name: str, documents: Path) -> tuple[pd.DataFrame, str]:
    """A kept table, or one of the hallway's page, beside the folder, as texts; and its link."""
    file = documents / f"{name}.csv"
    if file.exists():
        return pd.read_csv(file), f"results/{file.name}"
    block = read_text(documents.parent / HALLWAY_PAGE.name)
    block = block.partition(f"<!-- table {name} -->")[2].partition("<!-- end -->")[0]
    rows = [_cells(line) for line in block.splitlines() if " | " in line][1:]
    return pd.DataFrame(rows), HALLWAY_PAGE.name
