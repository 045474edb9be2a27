"""A fit in tables: what was found and how sure that is, and what the data leave open."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from rich.table import Table

from report.style import in_words
from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from serd_core.grid.grid import Outcome
from serd_core.grid.navigation import NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.uncertainty.identifiability import Identifiability, identifiability
from serd_core.uncertainty.information import fit_information
from serd_core.uncertainty.standard_errors import StandardErrors, standard_errors

_OUTCOME = re.compile(r"model (\d+) outcome (\d+)")


@dataclass(frozen=True, eq=False)
class Certainty:
    """errors: None where the fit is no maximum, which `problem` then says."""

    errors: StandardErrors | None
    told: Identifiability
    problem: str = ""


def certainty_of(problem: NavigationProblem, decisions: Decisions, fit: FitResult) -> Certainty:
    """Standard errors with the prior's part; what is identified by the decisions alone."""
    information = fit_information(problem, decisions, fit)
    told = identifiability(information)
    try:
        return Certainty(standard_errors(problem, information, information.observed), told)
    except SerdError as error:
        return Certainty(None, told, str(error))


def weights_table(fit: FitResult, certainty: Certainty) -> Table:
    """One row per feature."""
    table = _table("Reward weights", "feature", ("weight", "standard error"))
    for row, name in enumerate(fit.feature_names):
        error = math.nan if certainty.errors is None else float(certainty.errors.reward[row])
        table.add_row(in_words(name), f"{fit.reward_weights[row]:+.2f}", _number(error))
    return table


def outcomes_table(problem: NavigationProblem, fit: FitResult, certainty: Certainty) -> Table:
    """One row per outcome model: probability and standard error of each outcome."""
    names = [outcome.name.lower() for outcome in Outcome]
    table = _table("Outcomes of a decision period, in % ± standard error", "model", names)
    for model, name in enumerate(problem.model_names):
        cells = []
        for outcome in range(len(names)):
            cell = f"{100 * fit.outcome_probabilities[model, outcome]:.1f}"
            if certainty.errors is not None:
                error = float(certainty.errors.outcome_probabilities[model, outcome])
                cell += f"±{_number(100 * error, digits=1)}"
            cells.append(cell)
        table.add_row(in_words(name), *cells)
    return table


def remarks(problem: NavigationProblem, certainty: Certainty) -> Iterable[str]:
    """What to be careful with."""
    if certainty.problem:
        yield f"no standard errors: {certainty.problem}"
    if not certainty.told.identified:
        yield (
            "not told by the decisions alone, so the prior decides: "
            f"{'; '.join(_open_numbers(problem, certainty.told))}"
        )


def certainty_values(certainty: Certainty) -> dict[str, Any]:
    """For programs; None for a standard error that is not finite."""
    errors = certainty.errors
    return {
        "standard_errors": None if errors is None else [_plain(each) for each in errors.reward],
        "outcome_standard_errors": None
        if errors is None
        else [[_plain(each) for each in row] for row in errors.outcome_probabilities],
        "identified_without_prior": certainty.told.identified,
        "open_directions": [str(direction) for direction in certainty.told.null],
    }


def _open_numbers(problem: NavigationProblem, told: Identifiability) -> Iterable[str]:
    """Everything that moves along a null direction; outcomes by the name of their model."""
    outcomes: dict[str, set[int]] = {}
    others = set()
    for name in {name for direction in told.null for name, _ in direction.loadings}:
        if found := _OUTCOME.search(name):
            outcomes.setdefault(problem.model_names[int(found[1])], set()).add(int(found[2]))
        else:
            others.add(in_words(name))
    yield from sorted(others)
    for model, numbers in sorted(outcomes.items()):
        names = (Outcome(number).name.lower() for number in sorted(numbers))
        yield f"{in_words(model)} ({', '.join(names)})"


def _plain(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _number(value: float, digits: int = 2) -> str:
    if math.isnan(value):
        return "not known"
    return "open" if math.isinf(value) else f"{value:.{digits}f}"


def _table(title: str, first: str, columns: Iterable[str]) -> Table:
    table = Table(title=title, title_justify="left")
    table.add_column(first)
    for name in columns:
        table.add_column(name, justify="right")
    return table
