"""The HTML page: template filled with numbers and embedded pictures, no outside resources."""

import base64
from collections.abc import Mapping

from jinja2 import Environment, PackageLoader, StrictUndefined

from report.figures.charts import OUTCOME_LABELS
from report.inputs import FileLink, ReportInputs
from report.style import counted, in_words, percent, seconds_in_words
from report.summary import Summary, headline_of

CAPTIONS: dict[str, str] = {
    "hallway": (
        "The hallway at one recorded moment. Each ochre dot is a walking person; its arrow points "
        "where the person walks and is as long as 0.7 s of walking; fading lines are the last "
        "seconds of the path. People keep to the right. The robot is the large purple dot; its "
        "white line points forward. It starts in a dashed area and has to reach the green one."
    ),
    "visitation": (
        "Where the demonstrations took their decisions (darker: more often), with the recorded "
        "tracks as thin lines. Pale cells were never visited: there the model knows only what the "
        "reward and the shared outcome models imply."
    ),
    "policy": (
        "The learned strategy: the best action of each cell as an arrow (a dot means wait) "
        "on the value of the cell (darker: better). Cells framed in dashed red are traps: "
        "from there the arrows never lead to the goal."
    ),
    "arrival": (
        "Share of episodes that have arrived by each time. The dashed blue curve was computed "
        "from the learned model before driving; the red one was measured. Bands hold 95 % at each "
        "time by itself: blue, where the share of that many episodes would fall if the model were "
        "right; red, the exact confidence interval of the measured share. A good model keeps "
        "the red curve inside the blue band. The model counts whole decision periods; how far into "
        "the last one the robot arrives is taken from the demonstrations; without any, an "
        "arrival counts at the end of its period."
    ),
    "weights": (
        "The learned reward per unit of each feature. Blue bars attract, red bars repel. Compare a "
        "weight with how often its feature occurs: a robot at the goal stays there and collects "
        "that weight in every period that follows."
    ),
    "outcomes": (
        "Outcomes of an intended move within one decision period, relative to its direction, "
        "in four situations: with the flow of people, against it, across it, and waiting. Hatched "
        "grey: counted from the demonstrations alone. Blue: after learning together with the "
        "reward. The fewer the decisions, the more the model may move away from the count."
    ),
    "features": (
        "The features the reward is made of, from -1 (blue) to 1 (red). The social norm depends "
        "on the action: 1 for going with the flow or waiting, -1 for going against it."
    ),
    "progress": (
        "The log posterior after each step of the optimiser. It should rise and then level off."
    ),
}

TITLES: dict[str, str] = {
    "hallway": "The hallway",
    "visitation": "Demonstrations",
    "policy": "Learned strategy",
    "arrival": "Time of arrival, predicted and measured",
    "weights": "Learned reward",
    "outcomes": "Learned dynamics",
    "features": "Features",
    "progress": "Learning progress",
}


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
        titles=TITLES,
        captions=CAPTIONS,
        outcome_labels=OUTCOME_LABELS,
        episodes=inputs.episodes,
        run=inputs.run,
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
