"""Every file of a report: figures, tables, summary and the page, each written atomically.

The page is one HTML file with embedded pictures and without resources from outside.
"""

import base64
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from serd_app.learning.knowledge import DynamicsRow, WeightRow, spanned
from serd_app.navigation.comparison import Agreement, reasons_text
from serd_app.report.charts import (
    OUTCOME_LABELS,
    draw_comparison,
    draw_forecasts,
    draw_outcomes,
)
from serd_app.report.inputs import FileLink, Forecast, ReportInputs, in_words, percent
from serd_app.report.maps import draw_gain, draw_policy_map, draw_visitation
from serd_app.report.style import save_figure, svg_bytes
from serd_app.report.summary import Summary, headline_of, known_decisions, span_in_words, summary_of
from serd_bag.files import atomic_write_bytes, atomic_write_text
from serd_bag.quantities import counted, seconds_in_words
from serd_core.bayes.information import PRIOR_ONLY
from serd_core.demonstrations.decisions import state_counts

_OWN_FILES: tuple[FileLink, ...] = (
    FileLink("summary.json", "every number of this page"),
    FileLink("figures/", "all figures as PNG and SVG"),
)


@dataclass(frozen=True, eq=False)
class Reported:
    """page: its file; summary: the numbers of it."""

    page: Path
    summary: Summary


def write_report(inputs: ReportInputs, directory: Path) -> Reported:
    """Write everything below `directory` (made if missing), with the page as report.html.

    The page is written last: when it is there, all it links to is there.
    """
    folder = Path(directory).resolve()
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    summary = summary_of(inputs)
    pictures = {}
    for name, figure in _figures(inputs).items():
        pictures[name] = svg_bytes(figure)
        atomic_write_bytes(folder / "figures" / f"{name}.svg", pictures[name])
        save_figure(folder / "figures" / f"{name}.png", figure)
    numbers = json.dumps(summary, indent=2, allow_nan=False)
    atomic_write_text(folder / "summary.json", numbers + "\n")
    page = folder / "report.html"
    atomic_write_text(page, render_page(inputs, summary, pictures))
    return Reported(page, summary)


def _figures(inputs: ReportInputs) -> dict[str, Figure]:
    """Maps and charts by their names in the template of the page."""
    strategy, recorded = inputs.strategy, inputs.recorded
    scenario, problem = strategy.scenario, strategy.problem
    grid = problem.grid
    found: dict[str, Figure] = {}
    if inputs.knowledge is not None:
        found["gain"] = draw_gain(scenario, grid, inputs.knowledge.gain_nats)
    if len(inputs.demonstrations):
        visits = state_counts(inputs.demonstrations, grid.n_states)
        found["visitation"] = draw_visitation(scenario, grid, visits, inputs.demonstration_tracks_m)
    traps, policy = strategy.driven.learned_traps, strategy.policy
    trapped, timeout_s = traps.looping | traps.unlikely, strategy.timeout_s
    found["policy"] = draw_policy_map(
        scenario, grid, policy.value, policy.greedy, problem.goal_states, trapped
    )
    recorded_s = () if recorded is None else recorded.times_s
    if inputs.episodes:
        times_s = inputs.arrival_times_s
        found["arrival"] = draw_comparison(inputs.predicted, times_s, timeout_s, recorded_s)
    if inputs.forecasts:
        laws = {each.name: each.law for each in inputs.forecasts}
        found["forecast"] = draw_forecasts(laws, timeout_s, recorded_s)
    known = {} if inputs.knowledge is None else inputs.knowledge.by_model
    found["outcomes"] = draw_outcomes(
        [row for row, _ in shown_outcomes(inputs)],
        dict(zip(problem.model_names, known_decisions(inputs).tolist(), strict=True)),
        {name: rows[0].known_from for name, rows in known.items()},
    )
    return found


def _spanned(row: WeightRow) -> str:
    return spanned(row.lower, row.median, row.upper, ".4f")


def _counted(row: DynamicsRow) -> str:
    return _percents(row.counted_lower, row.counted, row.counted_upper)


def _joint(row: DynamicsRow) -> str:
    return _percents(row.joint_lower, row.joint, row.joint_upper)


def render_page(inputs: ReportInputs, summary: Summary, pictures: Mapping[str, bytes]) -> str:
    """The whole page as text; `pictures` are SVG bytes by figure name."""
    problem = inputs.strategy.problem
    environment = Environment(
        loader=PackageLoader("serd_app.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"in_words": in_words, "seconds": seconds_in_words}
    environment.filters |= {"spanned": _spanned, "counted": _counted, "joint": _joint}
    return environment.get_template("report.html.j2").render(
        inputs=inputs,
        headline=headline_of(summary),
        no_prediction=reasons_text(summary["no_prediction_because"]),
        summary=summary,
        summary_rows=summary_rows(summary),
        pictures={name: base64.b64encode(svg).decode() for name, svg in pictures.items()},
        outcome_labels=OUTCOME_LABELS,
        models=[problem.model_names[m] for m in problem.used_models],
        links=inputs.files + _OWN_FILES,
        has_tracks=bool(inputs.demonstration_tracks_m),
        forecasts=[_forecast_row(each) for each in inputs.forecasts],
        outcome_rows=list(shown_outcomes(inputs)),
        dynamics_taken=_sentence_of(summary, "joint_dynamics"),
    )


def _sentence_of(summary: Summary, key: str) -> str:
    return next((each["sentence"] for each in summary["checks"] if each["key"] == key), "")


def shown_outcomes(inputs: ReportInputs) -> Iterator[tuple[DynamicsRow, str]]:
    """Counted dynamics beside those that were learned with rewards, and what they are known from.

    Fits that were not compared have no interval of counts, those without a posterior none at all.
    """
    problem, fit, known = inputs.strategy.problem, inputs.fit, inputs.knowledge
    both = {(row.model, row.outcome): row for row in inputs.both}
    decisions = known_decisions(inputs)
    for m in problem.used_models:
        name, source = problem.model_names[m], "moves" if decisions[m] else PRIOR_ONLY
        for k, outcome in enumerate(OUTCOME_LABELS):
            counts, learned = (
                fit.initial_outcome_probabilities[m, k],
                fit.outcome_probabilities[m, k],
            )
            ends = np.nan, np.nan
            if known is not None:
                row = known.by_model[name][k]
                source, ends = row.outcome_known_from, (row.lower, row.upper)
            alone = DynamicsRow(name, outcome, np.nan, counts, np.nan, ends[0], learned, ends[1])
            yield both.get((name, outcome), alone), source


def _percents(lower: float, middle: float, upper: float) -> str:
    if np.isnan(lower + upper):
        return f"{100 * middle:.1f} %"
    return spanned(100 * lower, 100 * middle, 100 * upper, ".1f", " %")


def summary_rows(summary: Summary) -> list[tuple[str, str]]:
    """The summary table: names and values as text."""
    recorded, times_s = [], summary["recorded_times_s"]
    if times_s:
        recorded = [
            ("Recorded arrivals", f"{len(times_s)} of them, after {span_in_words(times_s)}")
        ]
    return [
        (
            "Demonstrations",
            f"{summary['n_demonstrations']} with {counted(summary['n_decisions'], 'decision')}",
        ),
        *recorded,
        *_arrival_rows(summary),
        ("Trap states", str(summary["n_trap_states"])),
        *(
            ("Plan", f"{remark[0].upper()}{remark[1:]}.")
            for remark in summary["plan_remarks"]
            if not remark.startswith("the data do not support")
        ),
        (
            "Fit",
            f"{'converged' if summary['converged'] else 'did NOT converge'} "
            f"after {counted(summary['n_steps'], 'step')}, log posterior"
            f" {summary['objective']:.2f}",
        ),
    ]


def _arrival_rows(summary: Summary) -> list[tuple[str, str]]:
    """Measured beside predicted arrival, or predicted alone where nothing drove.

    What is predicted is left out where that is not supported.
    """
    predicted = f"predicted {percent(summary['predicted_arrival_probability'])}"
    median = f"predicted {_seconds(summary['predicted_median_s'])}"
    none, reasons = [], summary["no_prediction_because"]
    if reasons:
        none = [("Predicted arrival", f"none, because {reasons_text(reasons)}")]
    if summary["measured_arrival_interval_95"] is None or summary["agreement"] is None:
        return none or [("Arrives", predicted), ("Median time of arrival", median)]
    low, high = summary["measured_arrival_interval_95"]
    beside = ("", "") if none else (f"; {predicted}", f"; {median}")
    return [
        *none,
        (
            "Arrived",
            f"{summary['n_arrived']} of {counted(summary['n_episodes'], 'episode')} "
            f"({percent(summary['measured_arrival_probability'] or 0.0)}, 95 % interval "
            f"{percent(low)} to {percent(high)}){beside[0]}",
        ),
        ("Median time of arrival", f"{_seconds(summary['measured_median_s'])}{beside[1]}"),
        ("Largest gap of the two arrival curves", Agreement(**summary["agreement"]).gap_text),
        (
            "Contacts",
            f"robot ran into people {summary['robot_on_person_contacts']} times, people into the "
            f"robot {summary['person_on_robot_contacts']} times, "
            f"walls touched {summary['wall_contacts']} times",
        ),
    ]


def _forecast_row(forecast: Forecast) -> tuple[str, str, str, str]:
    """Start, probability of arriving, and by when half and nine in ten do."""
    law = forecast.law
    half, most = (law.quantile_s(share) for share in (0.5, 0.9))
    trapped = " (the learned policy does not arrive)" if forecast.trapped else ""
    return f"{forecast.name}{trapped}", percent(float(law.cdf[-1])), _by(half), _by(most)


def _by(time_s: float | None) -> str:
    return "not in time" if time_s is None else seconds_in_words(time_s)


def _seconds(value: float | None) -> str:
    return "more than half never arrived" if value is None else seconds_in_words(value)
