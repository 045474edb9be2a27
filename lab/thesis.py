"""The table of docs/thesis.md: what the thesis shows, the command, the number here, the difference.

`python -m lab keep` writes it; its numbers are computed from the tables that the documents keep.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from lab.experiments.study.hallway.tables.page import PAGE as HALLWAY_PAGE
from serd_bag.files import read_text

#: Below the root, as `lab.RESULTS`.
PAGE = Path("docs/thesis.md")
_BEGIN, _END = "<!-- table thesis -->\n", "<!-- end -->\n"
_HEAD = "| thesis | shows | command | number here | where it differs |\n" + 5 * "| --- " + "|\n"


@dataclass(frozen=True)
class Shown:
    """A figure, table or claim.

    words: of `python -m lab`; table: the kept one of the number, or one of the hallway's page.
    """

    item: str
    shows: str
    words: str = ""
    table: str = ""
    number: Callable[[pd.DataFrame], str] = lambda _: ""
    differs: str = ""


def _modes(table: pd.DataFrame) -> str:
    count = table.groupby(["learner", "mode"])["n"].sum().astype(int)
    return (
        f"SERD: {count['MDCE SERD', 'A']} sets in A, {count['MDCE SERD', 'B']} in B;"
        f" IRL: {count['MDCE IRL', 'A']} in A, {count['MDCE IRL', 'B']} in B"
    )


def _certainty(table: pd.DataFrame) -> str:
    largest = table[table["size"] == table["size"].max()]
    medians = largest.set_index(["learner", "mode"])["median"]
    serd = ", ".join(f"{medians['MDCE SERD', mode]:.1e} in {mode}" for mode in "AB")
    irl = f"{medians['MDCE IRL', 'B']:.1e} in B"
    return f"at {largest['size'].iloc[0]} demonstrations SERD {serd}; IRL {irl}"


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
    parts = (f"{prior}: p₁ = {' or '.join(texts)}" for prior, texts in shares.items())
    return "; ".join(parts).replace("|", r"\|")


def _gridworld(learners: Sequence[str], **measures: str) -> Callable[[pd.DataFrame], str]:
    """Medians at 12 demonstrations; measures: their words by the names of the table."""

    def number(table: pd.DataFrame) -> str:
        parts = []
        for name, words in measures.items():
            rows = table[(table["size"] == _SIZE) & (table["measure"] == name)]
            medians = rows.set_index("learner")["median"]
            shown = (f"{learner} {medians[learner]:.3f}" for learner in learners)
            parts.append(f"{words}: {', '.join(shown)}")
        return f"at {_SIZE} demonstrations {'; '.join(parts)}"

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
            shown = (f"{each} {medians[each]:.3f}" for each in _HALLWAY_METHODS)
            parts.append(f"{words}: {', '.join(shown)}")
        return f"at {largest['size'].iloc[0]} demonstrations " + "; ".join(parts)

    return number


_HALLWAY_METHODS = ("MDCE SERD", "MDCE IRL, likelihood", "REIRL")


def _ascents(table: pd.DataFrame) -> str:
    by_name = table.set_index("ascent")
    lost = by_name["objective"].max() - by_name.loc["gradient", "objective"]
    return (
        f"{by_name.loc['gradient', 'n_steps']} steps of gradient ascent end {lost:.2f} below the"
        f" maximum, which the trust region finds in {by_name.loc['trust-region', 'n_steps']}"
    )


def _arrivals(table: pd.DataFrame) -> str:
    """Titles of the page's table: method, arrived, predicted, mean time, predicted, ..."""
    means = table.set_index(0)
    shown = (f"{name} {means.loc[name, 3]}, {means.loc[name, 4]}" for name in _HALLWAY_METHODS)
    return f"mean time, predicted: {'; '.join(shown)}"


def _traps(table: pd.DataFrame) -> str:
    medians = table.set_index(0)[1]
    return "median: " + ", ".join(f"{name} {medians[name]}" for name in _HALLWAY_METHODS)


SHOWN = (
    Shown(
        "Figs. 1.1, 1.2, 2.1, 3.1–3.3, 4.1, 4.4, 4.7, 5.1–5.4; Tables 2.1, 2.2, 3.1, 4.1, 5.1",
        "drawings and definitions without a result",
        differs="the world is this project's and not MORSE ([method.md](method.md))",
    ),
    Shown(
        "Algorithm 1, line 9",
        "SERD by gradient ascent",
        "ascents --jobs 1",
        "ascents",
        _ascents,
        "printed as a step along ∇L; it is one along ∇J ([thesis_slips.md](thesis_slips.md))",
    ),
    Shown(
        "Section 4.1, Figs. 4.2, 4.3",
        "demonstrations have several explanations",
        "multi-start",
        differs="no kept table; explanations and their objectives are printed",
    ),
    Shown(
        "Table 4.2",
        "cost of a gradient: exponents of states, actions and parameters; LU 3, 3, 1; soft step"
        " 2, 2, 1; hard step 2, 1, 1",
        "policy-cost --jobs 1 --repeats 20",
        "policy-cost",
        _exponents,
        "agrees; a hard step is still small enough for overhead to show",
    ),
    Shown(
        "Fig. 4.5",
        "parts of the Q-gradients of the minimum example",
        differs="not drawn; tests compare both gradients with finite differences",
    ),
    Shown(
        "Fig. 4.6, Table 4.3",
        "distribution that each prior prefers",
        "priors",
        "priors",
        _distributions,
        "agrees; L2 prefers none",
    ),
    Shown(
        "Fig. 4.8",
        "SERD finds both explanations of the minimum example, IRL one, in 5,000 sets",
        "minimum-example",
        "minimum-example",
        _modes,
        "agrees; A: b leads to a state that is avoided; IRL ends in A for small sets in which a led"
        " there in at most half of the steps",
    ),
    Shown(
        "Fig. 4.9",
        "log-likelihood of the demonstrations in both modes",
        "minimum-example",
        "minimum-example",
        _certainty,
        "agrees, but SERD's is a little nearer to 0 than IRL's, which the thesis found alike",
    ),
    Shown(
        "Figs. 4.10, 4.11",
        "training and transfer environment of the gridworld",
        "gridworld",
        differs="generated landscapes, or own aerial images by `--image`, in place of Google's",
    ),
    Shown(
        "Fig. 4.12 a",
        "MDCE SERD predicts better than MDCE IRL, and that better than REIRL; significant above 3"
        " demonstrations",
        "gridworld",
        "gridworld",
        _gridworld(_MDCE, log_likelihood="log-likelihood"),
        "agrees from 6 demonstrations on; at 1 and 3 SERD without a prior is worse, with priors by"
        " evidence better ([chapter_4.md](chapter_4.md))",
    ),
    Shown(
        "Fig. 4.12 b, c, d",
        "dynamics, policy and transfer; transfer significant from 12 on",
        "gridworld",
        "gridworld",
        _gridworld(
            _MDCE,
            dynamics_divergence="dynamics",
            policy_divergence="policy",
            transfer_log_likelihood="transfer",
        ),
        "agrees from 12, 6 and 12 demonstrations on ([chapter_4.md](chapter_4.md))",
    ),
    Shown(
        "Fig. 4.13",
        "PM SERD, with and without priors",
        "gridworld --expert pm",
        "gridworld-pm",
        _gridworld(
            _PM,
            log_likelihood="log-likelihood",
            dynamics_divergence="dynamics",
            transfer_log_likelihood="transfer",
        ),
        "agrees from 6 demonstrations on; without priors it does not over-fit from 12 on"
        " ([chapter_4.md](chapter_4.md))",
    ),
    Shown(
        "Section 5.2",
        "fits that are stopped by validation demonstrations",
        "early-stopping",
        differs="no kept table",
    ),
    Shown(
        "Figs. 5.5, 5.6, 5.7",
        "features, state space and demonstrations of the hallway",
        "hallway",
        differs="own hallway; scripted people in place of persons"
        " ([hallway_study.md](hallway_study.md))",
    ),
    Shown(
        "Fig. 5.8",
        "weight λ of the divergence prior by number of demonstrations",
        "hallway",
        differs="agrees ([claim by claim](hallway_study.md#claim-by-claim))",
    ),
    Shown(
        "Fig. 5.9 a, b",
        "SERD predicts test and transfer better than IRL, REIRL is last",
        "hallway",
        "hallway",
        _hallway("test_log_likelihood test", "transfer_log_likelihood transfer"),
        "agrees from four demonstrations on for test, from twelve on for transfer",
    ),
    Shown(
        "Fig. 5.9 c",
        "SERD's dynamics are nearer than the M-estimate",
        "hallway",
        "hallway",
        _hallway("dynamics_divergence divergence"),
        "does not agree for the scripted people, who do not know the dynamics; agrees for the"
        " expert who does",
    ),
    Shown(
        "Fig. 5.10",
        "predicted and measured time of arrival",
        "hallway",
        "arrival",
        _arrivals,
        "does not agree for IRL, whose prediction is as good as SERD's; agrees for REIRL",
    ),
    Shown(
        "Fig. 5.11",
        "policies and their trap states",
        "hallway",
        "traps",
        _traps,
        "agrees in part: neither SERD nor IRL has traps, REIRL has",
    ),
)


def filled(page: str, documents: Path) -> str:
    """The page with its table made from the kept tables in a folder."""
    before, _, rest = page.partition(_BEGIN)
    after = rest.partition(_END)[2]
    rows = "".join(_row(shown, documents) for shown in SHOWN)
    return f"{before}{_BEGIN}\n{_HEAD}{rows}\n{_END}{after}"


def _table(name: str, documents: Path) -> tuple[pd.DataFrame, str]:
    """A kept table, or one of the hallway's page, beside the folder, as texts; and its link."""
    file = documents / f"{name}.csv"
    if file.exists():
        return pd.read_csv(file), f"results/{file.name}"
    block = read_text(documents.parent / HALLWAY_PAGE.name)
    block = block.partition(f"<!-- table {name} -->")[2].partition("<!-- end -->")[0]
    lines = [line for line in block.splitlines() if line.startswith("| ")][1:]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return pd.DataFrame(rows), HALLWAY_PAGE.name


def _row(shown: Shown, documents: Path) -> str:
    command = f"`python -m lab {shown.words}`" if shown.words else ""
    number = ""
    if shown.table:
        table, link = _table(shown.table, documents)
        number = f"{shown.number(table)} ([{shown.table}]({link}))"
        number = number.replace("-0.", "−0.").replace("-1.", "−1.").replace(" -", " −")
    cells = (shown.item, shown.shows, command, number, shown.differs)
    return f"| {' | '.join(cells)} |\n"
