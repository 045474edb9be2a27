"""Precision of each outcome model in a fit, its source, and what demonstration would add most."""

from collections.abc import Iterable, Mapping
from dataclasses import astuple, dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.bayes.design import expected_information_gain
from serd_core.bayes.information import outcome_information
from serd_core.bayes.laplace import Laplace, laplace
from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from serd_core.grid.grid import Grid, Outcome
from serd_core.grid.navigation import NavigationProblem
from serd_core.learners.fit_result import FitResult
from storage.table import columns_of, read_rows, write_table

#: Share of the posterior within the intervals.
MASS = 0.9


@dataclass(frozen=True)
class OutcomeRow:
    """The posterior of one outcome probability; what is in nats is of its whole model.

    known_from: counts, choices, both, or prior only; shared_most_with: a feature of the reward.
    """

    model: str
    outcome: str
    decisions: float
    lower: float
    median: float
    upper: float
    known_from: str
    from_transitions_nats: float
    from_choices_nats: float
    shared_with_rewards_nats: float
    shared_most_with: str


@dataclass(frozen=True)
class GainRow:
    """What a demonstration that starts in a cell is expected to add."""

    x_m: float
    y_m: float
    gain_nats: float


OUTCOME_COLUMNS, GAIN_COLUMNS = columns_of(OutcomeRow), columns_of(GainRow)


@dataclass(frozen=True)
class Knowledge:
    """outcomes: by model, then by outcome; gains: of every cell, in the order of the states."""

    outcomes: tuple[OutcomeRow, ...]
    gains: tuple[GainRow, ...]

    @property
    def by_model(self) -> dict[str, tuple[OutcomeRow, ...]]:
        """The rows of each outcome model."""
        groups = groupby(self.outcomes, key=lambda row: row.model)
        return {model: tuple(rows) for model, rows in groups}

    @property
    def gain_nats(self) -> FloatArray:
        """(S,) of all cells."""
        return np.array([row.gain_nats for row in self.gains])

    @property
    def next_start(self) -> GainRow:
        """Where a demonstration is expected to add most."""
        return max(self.gains, key=lambda row: row.gain_nats)


def posterior_of(
    problem: NavigationProblem, decisions: Decisions, fit: FitResult
) -> Laplace | None:
    """None where the fit has none: its prior is no density, or it is at no maximum."""
    try:
        return laplace(problem, decisions, fit)
    except SerdError:
        return None


def knowledge_of(problem: NavigationProblem, posterior: Laplace) -> Knowledge | None:
    """None where the dynamics were not learned."""
    try:
        found = outcome_information(posterior, MASS)
        gain = expected_information_gain(posterior)
    except SerdError:
        return None
    outcomes = tuple(
        OutcomeRow(
            model=model,
            outcome=outcome.name.lower(),
            decisions=float(found.n_decisions[m]),
            lower=float(found.lower[m, outcome]),
            median=float(found.median[m, outcome]),
            upper=float(found.upper[m, outcome]),
            known_from=found.source(m),
            from_transitions_nats=float(found.from_transitions[m]),
            from_choices_nats=float(found.from_choices[m]),
            shared_with_rewards_nats=float(found.shared[m]),
            shared_most_with=problem.feature_names[found.partner[m]],
        )
        for m, model in enumerate(problem.model_names)
        for outcome in Outcome
    )
    points = zip(problem.grid.centers_m.tolist(), gain.tolist(), strict=True)
    return Knowledge(outcomes, tuple(GainRow(x_m, y_m, nats) for (x_m, y_m), nats in points))


def knowledge_lines(known: Knowledge, problem: NavigationProblem) -> Iterable[str]:
    """One line per outcome model that applies somewhere, and where to demonstrate next."""
    for model in (problem.model_names[m] for m in problem.used_models):
        row = known.by_model[model][Outcome.FORWARD]
        yield (
            f"{model.replace('_', ' ')}: {row.known_from}; {row.decisions:.0f} decisions:"
            f" {row.from_transitions_nats:.2f} nats, choices: {row.from_choices_nats:.2f} nats"
            f" ({row.shared_with_rewards_nats:.2f} shared with rewards, most with"
            f" {row.shared_most_with.replace('_', ' ')}); forward {100 * row.median:.0f} %"
            f" ({100 * row.lower:.0f} to {100 * row.upper:.0f})"
        )
    best = known.next_start
    yield (
        f"a demonstration from {best.x_m:g},{best.y_m:g} is expected to teach most:"
        f" {best.gain_nats:.2f} nats"
    )


def save_knowledge(files: Mapping[str, Path], known: Knowledge) -> None:
    """Write both tables."""
    write_table(files["posterior"], OUTCOME_COLUMNS, map(astuple, known.outcomes))
    write_table(files["gain"], GAIN_COLUMNS, map(astuple, known.gains))


def load_knowledge(files: Mapping[str, Path], grid: Grid) -> Knowledge | None:
    """What `save_knowledge` wrote for this grid; None where the fit had no posterior."""
    if not files["posterior"].exists():
        return None
    outcomes = read_rows(files["posterior"], OutcomeRow, OUTCOME_COLUMNS)
    gains = read_rows(files["gain"], GainRow, GAIN_COLUMNS)
    if len(gains) != grid.n_states:
        raise SerdError(
            f"{files['gain']} must have a row for each of {grid.n_states} cells, got {len(gains)}"
            "; learn again"
        )
    return Knowledge(outcomes, gains)
