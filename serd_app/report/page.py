"""The HTML page: template filled with numbers and embedded pictures, no outside resources."""

import base64
from collections.abc import Mapping

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from serd_app.report.figures.charts import OUTCOME_LABELS
from serd_app.report.inputs import FileLink, Forecast, ReportInputs, in_words, percent
from serd_app.report.summary import Summary, headline_of
from serd_bag.quantities import counted, seconds_in_words
from serd_core.demonstrations.decisions import HIDDEN
from serd_core.grid.grid import Action

#: Most surprising decisions and unusual episodes that are listed.
_LISTED = 12


def render_page(
    inputs: ReportInputs,
    summary: Summary,
    pictures: Mapping[str, bytes],
    links: tuple[FileLink, ...],
) -> str:
    """The whole page as text; `pictures` are SVG bytes by figure name."""
    environment = Environment(
        loader=PackageLoader("serd_app.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"in_words": in_words, "seconds": seconds_in_words}
    return environment.get_template("report.html.j2").render(
        inputs=inputs,
        headline=headline_of(summary),
        no_prediction=summary.no_prediction,
        summary=summary,
        summary_rows=summary_rows(summary),
        pictures={name: base64.b64encode(svg).decode() for name, svg in pictures.items()},
        outcome_labels=OUTCOME_LABELS,
        models=[inputs.problem.model_names[m] for m in inputs.problem.used_models],
        links=links,
        has_tracks=bool(inputs.demonstration_tracks_m),
        forecasts=[_forecast_row(each) for each in inputs.forecasts],
        surprises=surprise_rows(inputs),
        unusual=() if inputs.familiarity is None else inputs.familiarity.episodes[:_LISTED],
    )


def summary_rows(summary: Summary) -> list[tuple[str, str]]:
    """The summary table: names and values as text."""
    rows = [
        (
            "Demonstrations",
            f"{summary.n_demonstrations} with {counted(summary.n_decisions, 'decision')}",
        ),
        *([("Faults of the demonstrations", summary.faults)] if summary.faults else []),
        *([("Compared with the model", summary.compared)] if summary.compared else []),
        *_arrival_rows(summary),
        ("Trap states", str(summary.n_trap_states)),
        *(("Plan", _sentence(remark)) for remark in summary.plan_remarks),
        (
            "Fit",
            f"{'converged' if summary.converged else 'did NOT converge'} "
            f"after {counted(summary.n_steps, 'step')}, log posterior {summary.objective:.2f}",
        ),
    ]
    factors = [f"{name} {factor:.0f}" for name, factor in summary.real_time_factor.items()]
    return rows + (
        [("Times faster than real time (whole phase)", ", ".join(factors))] if factors else []
    )


def _arrival_rows(summary: Summary) -> list[tuple[str, str]]:
    """Measured beside predicted arrival, or predicted alone where nothing drove.

    What is predicted is left out where that is not supported.
    """
    predicted = f"predicted {percent(summary.predicted_arrival_probability)}"
    median = f"predicted {_seconds(summary.predicted_median_s)}"
    none = []
    if summary.no_prediction_because:
        none = [("Predicted arrival", f"none, because {summary.no_prediction}")]
    if summary.measured_arrival_interval_95 is None or summary.agreement is None:
        return none or [("Arrives", predicted), ("Median time of arrival", median)]
    low, high = summary.measured_arrival_interval_95
    beside = ("", "") if none else (f"; {predicted}", f"; {median}")
    return [
        *none,
        (
            "Arrived",
            f"{summary.n_arrived} of {counted(summary.n_episodes, 'episode')} "
            f"({percent(summary.measured_arrival_probability or 0.0)}, 95 % interval "
            f"{percent(low)} to {percent(high)}){beside[0]}",
        ),
        ("Median time of arrival", f"{_seconds(summary.measured_median_s)}{beside[1]}"),
        ("Largest gap of the two arrival curves", summary.agreement.gap_text),
        (
            "Contacts",
            f"robot ran into people {summary.robot_on_person_contacts} times, people into the "
            f"robot {summary.person_on_robot_contacts} times, "
            f"walls touched {summary.wall_contacts} times",
        ),
    ]


def _forecast_row(forecast: Forecast) -> tuple[str, str, str, str]:
    """Start, probability of arriving, and by when half and nine in ten do."""
    law = forecast.law
    half, most = (law.quantile_s(share) for share in (0.5, 0.9))
    trapped = " (the learned policy does not arrive)" if forecast.trapped else ""
    return f"{forecast.name}{trapped}", percent(float(law.cdf[-1])), _by(half), _by(most)


def _sentence(clause: str) -> str:
    return f"{clause[0].upper()}{clause[1:]}."


def _by(time_s: float | None) -> str:
    return "not in time" if time_s is None else seconds_in_words(time_s)


def surprise_rows(inputs: ReportInputs) -> list[tuple[int, float, str, str, str]]:
    """Episode, time in it, place, action and tail probability of the least likely decisions."""
    found = inputs.familiarity
    if found is None:
        return []
    decisions, grid = found.decisions, found.problem.grid
    episodes, first = np.unique(decisions.episode, return_index=True)
    began_s = dict(zip(episodes.tolist(), decisions.time_s[first].tolist(), strict=True))
    rows = np.argsort(found.tails, kind="stable")[:_LISTED]
    rows = rows[found.surprising[rows]]
    return [
        (
            int(decisions.episode[row]),
            float(decisions.time_s[row] - began_s[int(decisions.episode[row])]),
            "{:.2f}, {:.2f}".format(*grid.centers_m[decisions.state[row]]),
            "hidden" if action == HIDDEN else Action(action).name.lower(),
            f"{found.tails[row]:.1e}",
        )
        for row, action in zip(rows, decisions.action[rows].tolist(), strict=True)
    ]


def _seconds(value: float | None) -> str:
    return "more than half never arrived" if value is None else seconds_in_words(value)
