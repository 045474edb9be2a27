"""Every file of a report: figures, tables, summary and the page, each written atomically."""

import json
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from report.figures.arrival import (
    at_times,
    draw_arrival,
    measured_curve,
    predicted_curve,
    shown_until_s,
)
from report.figures.charts import (
    OUTCOME_LABELS,
    draw_outcomes,
    draw_progress,
    draw_weights,
)
from report.figures.hallway import draw_hallway
from report.figures.map_axes import layout_of
from report.figures.maps import draw_features, draw_gain, draw_policy_map, draw_visitation
from report.inputs import FileLink, ReportInputs
from report.page import render_page
from report.style import png_bytes, svg_bytes
from report.summary import decisions_per_model, summary_of, trapped_states
from serd_core.demonstrations.decisions import state_counts
from storage.episode_table import EpisodeResult
from storage.files import atomic_write_bytes, atomic_write_text
from storage.table import csv_text

_OWN_FILES = (
    FileLink("summary.json", "every number of this page"),
    FileLink("episodes.csv", "how each new episode ended"),
    FileLink("arrival_times.csv", "predicted and measured arrival curves with bands"),
    FileLink("reward_weights.csv", "learned reward weights"),
    FileLink("outcome_models.csv", "initial and learned outcome probabilities"),
    FileLink("figures/", "all figures as PNG and SVG"),
)


def write_report(inputs: ReportInputs, directory: Path) -> Path:
    """Write everything below `directory` (made if missing); returns the path of report.html.

    The page is written last: when it is there, all it links to is there.
    """
    folder = Path(directory).resolve()
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    summary = summary_of(inputs)
    pictures = {}
    for name, figure in all_figures(inputs).items():
        pictures[name] = svg_bytes(figure)
        atomic_write_bytes(folder / "figures" / f"{name}.svg", pictures[name])
        atomic_write_bytes(folder / "figures" / f"{name}.png", png_bytes(figure))
    for file_name, text in all_tables(inputs).items():
        atomic_write_text(folder / file_name, text)
    numbers = json.dumps(summary.as_json(), indent=2, allow_nan=False)
    atomic_write_text(folder / "summary.json", numbers + "\n")
    page = folder / "report.html"
    atomic_write_text(page, render_page(inputs, summary, pictures, _links(inputs)))
    return page


def _links(inputs: ReportInputs) -> tuple[FileLink, ...]:
    """The caller's files first; its words win where both describe one file."""
    given = {link.path for link in inputs.files}
    return inputs.files + tuple(link for link in _OWN_FILES if link.path not in given)


def all_tables(inputs: ReportInputs) -> dict[str, str]:
    """CSV text by file name."""
    return {
        "episodes.csv": episodes_table(inputs.episodes),
        "arrival_times.csv": arrival_table(inputs),
        "reward_weights.csv": weights_table(inputs),
        "outcome_models.csv": outcomes_table(inputs),
    }


def episodes_table(episodes: tuple[EpisodeResult, ...]) -> str:
    """One row per episode; time_of_arrival_s is empty unless the robot arrived."""
    columns = {
        "episode": [each.episode for each in episodes],
        "seed": [each.seed for each in episodes],
        "outcome": [each.outcome for each in episodes],
        "time_of_arrival_s": [
            each.time_of_arrival_s if each.arrived else None for each in episodes
        ],
        "path_length_m": [each.distance_m for each in episodes],
        "robot_on_person_contacts": [each.robot_on_person for each in episodes],
        "person_on_robot_contacts": [each.person_on_robot for each in episodes],
        "wall_contacts": [each.robot_on_wall for each in episodes],
    }
    return csv_text(list(columns), zip(*columns.values(), strict=True))


def arrival_table(inputs: ReportInputs) -> str:
    """Both curves with their bands at every time at which one of them steps."""
    n_episodes = len(inputs.episodes)
    predicted = predicted_curve(inputs.predicted, n_episodes)
    measured = measured_curve(inputs.arrival_times_s, inputs.timeout_s)
    times_s = np.union1d(predicted.time_s, measured.time_s)
    columns, header = [times_s], ["time_s"]
    for name, curve in (("predicted", predicted), ("measured", measured)):
        read = at_times(curve, times_s)
        columns += [read.probability, read.lower, read.upper]
        header += [f"{name}_cdf", f"{name}_lower_95", f"{name}_upper_95"]
    return csv_text(header, np.column_stack(columns).tolist())


def weights_table(inputs: ReportInputs) -> str:
    """feature, weight."""
    fit = inputs.fit
    rows = zip(fit.feature_names, fit.reward_weights.tolist(), strict=True)
    return csv_text(["feature", "reward_weight"], rows)


def outcomes_table(inputs: ReportInputs) -> str:
    """One row per model and outcome: number of decisions, initial and learned probability."""
    counts = decisions_per_model(inputs.problem, inputs.demonstrations).tolist()
    initial = inputs.fit.initial_outcome_probabilities.tolist()
    learned = inputs.fit.outcome_probabilities.tolist()
    rows = [
        (model, outcome, counts[m], initial[m][k], learned[m][k])
        for m, model in enumerate(inputs.problem.model_names)
        for k, outcome in enumerate(OUTCOME_LABELS)
    ]
    header = ["model", "outcome", "decisions_of_model"]
    return csv_text([*header, "initial_probability", "learned_probability"], rows)


def all_figures(inputs: ReportInputs) -> dict[str, Figure]:
    """Every figure of the report, keyed as in `report.page`."""
    return _map_figures(inputs) | _chart_figures(inputs)


def _map_figures(inputs: ReportInputs) -> dict[str, Figure]:
    layout, problem = layout_of(inputs.scenario), inputs.problem
    grid = problem.grid
    visits = state_counts(inputs.demonstrations, grid.n_states)
    known = inputs.knowledge
    gain = {} if known is None else {"gain": draw_gain(layout, grid, known.gain_nats)}
    return gain | {
        "hallway": draw_hallway(layout, inputs.snapshot),
        "visitation": draw_visitation(layout, grid, visits, inputs.demonstration_tracks_m),
        "policy": draw_policy_map(
            layout,
            grid,
            inputs.policy.value,
            inputs.policy.greedy,
            problem.goal_states,
            trapped_states(inputs),
        ),
        "features": draw_features(
            layout, grid, problem.features, problem.feature_names, problem.mdp.available
        ),
    }


def _chart_figures(inputs: ReportInputs) -> dict[str, Figure]:
    fit, n_episodes = inputs.fit, len(inputs.episodes)
    predicted = predicted_curve(inputs.predicted, n_episodes)
    measured = measured_curve(inputs.arrival_times_s, inputs.timeout_s)
    return {
        "arrival": draw_arrival(
            predicted,
            measured,
            n_episodes=n_episodes,
            shown_until_s=shown_until_s(inputs.predicted, inputs.arrival_times_s, inputs.timeout_s),
        ),
        "weights": draw_weights(fit.feature_names, fit.reward_weights),
        "outcomes": draw_outcomes(
            inputs.problem.model_names,
            fit.initial_outcome_probabilities,
            fit.outcome_probabilities,
            decisions_per_model(inputs.problem, inputs.demonstrations),
            inputs.knowledge,
        ),
        "progress": draw_progress(fit.objective_trace, converged=fit.converged),
    }
