"""What `serd learn` prints: the fit with standard errors, and what the data leave open."""

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

from rich.table import Table

from serd_app.journeys.learn import Learned
from serd_app.learning.knowledge import MASS, Certainty, knowledge_lines, spanned
from serd_app.learning.learning_files import LearningFiles
from serd_app.learning.methods import FitProgress, ProgressCallback
from serd_app.learning.outcome import FitOutcome
from serd_app.report.inputs import in_words
from serd_bag.quantities import counted
from serd_cli.output.terminal import (
    console,
    finite,
    finite_values,
    progress_console,
    table_of,
)
from serd_core.bayes.information import PRIOR_ONLY
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.grid.grid import Outcome


@contextmanager
def fit_progress() -> Iterator[ProgressCallback]:
    """What shows the steps of a fit in a line on stderr."""
    with progress_console.status("learning") as line:

        def show(progress: FitProgress) -> None:
            step = progress.step
            where = f"fit {progress.number} of {progress.total}, step {step.number}"
            line.update(f"learning: {where}: {step.objective:.4f} per decision")

        yield show


def print_learned(learned: Learned) -> None:
    """The fit as tables, what it was made of, and what the data leave open."""
    files, outcome, certainty = learned.files, learned.outcome, learned.certainty
    if learned.missing:
        progress_console.print(learned.missing, soft_wrap=True)
    console.print(_learned_from(files, outcome.decisions), soft_wrap=True)
    console.print(_weights_table(outcome, certainty))
    for feature in filter(lambda each: each.left_out, outcome.model.features):
        line = f"left out: {in_words(feature.name)}, as {feature.left_out}"
        console.print(line, soft_wrap=True)
    console.print(_outcomes_table(outcome, certainty))
    for line in (*files.remarks(), *_remarks(certainty)):
        console.print(line, style="yellow", soft_wrap=True)
    if outcome.knowledge is not None:
        console.print("What is known of outcomes and dwell times, from where:", style="bold")
        for line in knowledge_lines(outcome.knowledge, files.task.problem):
            console.print(f"  {line}", soft_wrap=True)
    for line in outcome.durations:
        console.print(line, soft_wrap=True)
    style = "yellow" if outcome.traps.n_looping_cells else None
    console.print(outcome.traps.sentence(), style=style, soft_wrap=True)
    console.print("Whether the data support it:", style="bold")
    for check in outcome.model.checks:
        style = "yellow" if check.mark == "fails" else None
        text = f"  {check.mark} {in_words(check.key)}: {check.sentence}"
        console.print(text, style=style, soft_wrap=True)
    console.print(outcome.summary(), soft_wrap=True)
    console.print(f"model: {learned.model.resolve()}", soft_wrap=True)
    if learned.page is not None:
        console.print(f"report: {learned.page}", soft_wrap=True)


def _learned_from(files: LearningFiles, decisions: TimedDecisions) -> str:
    left_out = f", {files.task.left_out} left out" if files.task.left_out else ""
    share = len(decisions) / max(files.n_read, 1)
    used = f" ({share:.0%} of {files.n_read} that were read)" if share < 1 else ""
    across = ", so every move is across it" if files.flow_from == "none" else ""
    place = f"scenario {files.task.scenario}" if files.task.scenario else "fitted grid"
    return (
        f"{counted(len(decisions), 'decision')} in {counted(len(decisions.episodes), 'episode')}"
        f"{used}{left_out}; {place}, flow of people: {files.flow_from}{across}, goal:"
        f" {'; '.join(f'{x:g},{y:g}' for x, y in files.goals_m)}"
    )


def learned_values(learned: Learned) -> dict[str, Any]:
    """The same by name; None for a standard error that is not finite."""
    files, outcome, certainty = learned.files, learned.outcome, learned.certainty
    errors = certainty.errors
    page = {} if learned.page is None else {"report": str(learned.page)}
    return {
        **outcome.values(),
        "validation_log_likelihoods": dict(outcome.validation),
        "mean_dwell_s": {each.name: each.mean_s for each in outcome.model.outcome_models},
        "outcome_probabilities": [each.learned for each in outcome.model.outcome_models],
        "standard_errors": errors and [finite(each) for each in errors.reward],
        # Counted dynamics are taken as known.
        "outcome_standard_errors": errors
        and bool(errors.outcome_probabilities.any())
        and [[finite(each) for each in row] for row in errors.outcome_probabilities],
        "checks": [each.model_dump() for each in outcome.model.checks],
        "knowledge": None if outcome.knowledge is None else _known(asdict(outcome.knowledge)),
        "scenario": files.task.scenario,
        "flow": files.flow_from,
        "goals_m": files.goals_m,
        "n_read": files.n_read,
        "n_after_goal": files.n_after_goal,
        "n_elsewhere": files.n_elsewhere,
        "n_reaching_goal": len(files.reaching),
        "model": str(learned.model.resolve()),
        **page,
    }


def _known(tables: dict[str, Any]) -> dict[str, Any]:
    """The tables of rows, with None for numbers that are not known."""
    return {name: [finite_values(row) for row in rows] for name, rows in tables.items()}


def _weights_table(outcome: FitOutcome, certainty: Certainty) -> Table:
    """One row per feature: the interval of the posterior, without one the standard error."""
    known, weights = outcome.knowledge, outcome.fit.reward_weights
    if known is None:
        table = table_of("Reward weights", "feature", ("weight", "standard error"))
        for row, name in enumerate(outcome.fit.feature_names):
            error = math.nan if certainty.errors is None else float(certainty.errors.reward[row])
            table.add_row(in_words(name), f"{weights[row]:+.2f}", _number(error))
        return table
    title = f"Reward weights, and what holds {100 * MASS:.0f} % of the posterior"
    table = table_of(title, "feature", ("weight", "posterior", "known from"))
    for each, weight in zip(known.weights, weights, strict=True):
        interval = spanned(each.lower, each.median, each.upper, "+.2f")
        table.add_row(in_words(each.feature), f"{weight:+.2f}", interval, each.known_from)
    return table


def _outcomes_table(outcome: FitOutcome, certainty: Certainty) -> Table:
    """One row per outcome model: interval of each probability, without one the standard error."""
    names, known = [each.name.lower() for each in Outcome], outcome.knowledge
    shown = "± standard error" if known is None else f"({100 * MASS:.0f} % of the posterior)"
    shown += "" if known is None else "; * from the prior"
    table = table_of(f"Outcomes of a decision, in % {shown}", "model", names)
    for number in outcome.problem.used_models.tolist():
        model, cells = outcome.model.outcome_models[number], []
        for place, probability in enumerate(model.learned):
            cell = f"{100 * probability:.1f}"
            if known is not None:
                row = known.by_model[model.name][place]
                lower, median, upper = (100 * x for x in (row.lower, row.median, row.upper))
                cell = f"{median:.1f} ({lower:.0f}–{upper:.0f})"
                cell += "*" * (row.outcome_known_from == PRIOR_ONLY)
                cell = "not mixed" if math.isnan(lower + median + upper) else cell
            elif certainty.errors is not None:
                error = float(certainty.errors.outcome_probabilities[number, place])
                cell += f"±{_number(100 * error, digits=1)}"
            cells.append(cell)
        table.add_row(in_words(model.name), *cells)
    return table


def _remarks(certainty: Certainty) -> Iterable[str]:
    """Why there are no standard errors."""
    if certainty.problem:
        yield f"no standard errors: {certainty.problem}"


def _number(value: float, digits: int = 2) -> str:
    if math.isnan(value):
        return "not known"
    return "open" if math.isinf(value) else f"{value:.{digits}f}"
