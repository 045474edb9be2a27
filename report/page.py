"""The HTML page: template filled with numbers and embedded pictures, no outside resources."""

import base64
from collections.abc import Mapping

from jinja2 import Environment, PackageLoader, StrictUndefined

from report.figures.charts import OUTCOME_LABELS
from report.inputs import FileLink, ReportInputs
from report.style import in_words, percent
from report.summary import Summary, headline_of
from storage.quantities import counted, seconds_in_words


def render_page(
    inputs: ReportInputs,
    summary: Summary,
    pictures: Mapping[str, bytes],
    links: tuple[FileLink, ...],
) -> str:
    """The whole page as text; `pictures` are SVG bytes by figure name."""
    environment = Environment(
        loader=PackageLoader("report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"in_words": in_words, "seconds": seconds_in_words}
    return environment.get_template("report.html.j2").render(
        title=inputs.title,
        scenario=inputs.scenario,
        headline=headline_of(summary),
        summary=summary,
        summary_rows=summary_rows(summary),
        pictures={name: base64.b64encode(svg).decode() for name, svg in pictures.items()},
        outcome_labels=OUTCOME_LABELS,
        episodes=inputs.episodes,
        run=inputs.run,
        knowledge=inputs.knowledge,
        links=links,
    )


def summary_rows(summary: Summary) -> list[tuple[str, str]]:
    """The summary table: names and values as text."""
    low, high = summary.measured_arrival_interval_95
    rows = [
        (
            "Demonstrations",
            f"{summary.n_demonstrations} with {counted(summary.n_decisions, 'decision')}",
        ),
        (
            "Arrived",
            f"{summary.n_arrived} of {counted(summary.n_episodes, 'episode')} "
            f"({percent(summary.measured_arrival_probability)}, 95 % interval "
            f"{percent(low)} to {percent(high)}); "
            f"predicted {percent(summary.predicted_arrival_probability)}",
        ),
        (
            "Median time of arrival",
            f"{_seconds(summary.measured_median_s)}; "
            f"predicted {_seconds(summary.predicted_median_s)}",
        ),
        ("Largest gap of the two arrival curves", f"{summary.largest_cdf_gap:.2f}"),
        (
            "Contacts",
            f"robot ran into people {summary.robot_on_person_contacts} times, people into the "
            f"robot {summary.person_on_robot_contacts} times, "
            f"walls touched {summary.wall_contacts} times",
        ),
        ("Trap states", str(summary.n_trap_states)),
        (
            "Fit",
            f"{'converged' if summary.converged else 'did NOT converge'} "
            f"after {counted(summary.n_steps, 'step')}, log posterior {summary.objective:.2f}",
        ),
    ]
    factors = [f"{name} {factor:.0f}" for name, factor in summary.real_time_factor.items()]
    return rows + ([("Times faster than real time", ", ".join(factors))] if factors else [])


def _seconds(value: float | None) -> str:
    return "more than half never arrived" if value is None else seconds_in_words(value)
