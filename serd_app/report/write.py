"""Every file of a report: figures, tables, summary and the page, each written atomically."""

import json
from dataclasses import astuple, fields
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from serd_app.navigation.evaluation.familiarity import ScoredEpisode
from serd_app.report.figures.arrival import (
    at_times,
    draw_comparison,
    draw_forecasts,
    measured_curve,
    predicted_curve,
)
from serd_app.report.figures.charts import (
    OUTCOME_LABELS,
    draw_outcomes,
    draw_progress,
    draw_weights,
)
from serd_app.report.figures.hallway import draw_hallway
from serd_app.report.figures.maps import (
    draw_features,
    draw_flow_map,
    draw_gain,
    draw_policy_map,
    draw_surprises,
    draw_visitation,
)
from serd_app.report.inputs import FileLink, ReportInputs
from serd_app.report.page import render_page
from serd_app.report.style import save_figure, svg_bytes
from serd_app.report.summary import known_decisions, summary_of, trapped_states
from serd_bag.files import atomic_write_bytes, atomic_write_text
from serd_core.demonstrations.decisions import state_counts
from serd_core.grid.navigation import NO_FLOW
from serd_files.episode_table import EpisodeResult
from serd_files.table import csv_text

_COMPARED = "compared.csv"
_OWN_FILES = (
    FileLink("summary.json", "every number of this page"),
    FileLink("reward_weights.csv", "learned reward weights"),
    FileLink("outcome_models.csv", "initial and learned outcome probabilities"),
    FileLink("figures/", "all figures as PNG and SVG"),
)
_FILES_OF_EPISODES = (
    FileLink("episodes.csv", "how each new episode ended"),
    FileLink("arrival_times.csv", "predicted and measured arrival curves with bands"),
)


def write_report(inputs: ReportInputs, directory: Path) -> Path:
    """Write everything below `directory` (made if missing); returns the path of report.html.

    The page is written last: when it is there, all it links to is there.
    """
    folder = Path(directory).resolve()
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    summary = summary_of(inputs)
    pictures = {}
    for name, figure in (_map_figures(inputs) | _chart_figures(inputs)).items():
        pictures[name] = svg_bytes(figure)
        atomic_write_bytes(folder / "figures" / f"{name}.svg", pictures[name])
        save_figure(folder / "figures" / f"{name}.png", figure)
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
    own = _OWN_FILES + (_FILES_OF_EPISODES if inputs.episodes else ())
    if inputs.familiarity is not None:
        own += (FileLink(_COMPARED, "how usual each demonstration is for the model"),)
    return inputs.files + tuple(link for link in own if link.path not in given)


def all_tables(inputs: ReportInputs) -> dict[str, str]:
    """CSV text by file name."""
    driven = {}
    if inputs.episodes:
        driven["episodes.csv"] = episodes_table(inputs.episodes)
        driven["arrival_times.csv"] = arrival_table(inputs)
    if inputs.familiarity is not None:
        names = [field.name for field in fields(ScoredEpisode)]
        driven[_COMPARED] = csv_text(names, map(astuple, inputs.familiarity.episodes))
    return driven | {
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
    counts = known_decisions(inputs).tolist()
    initial = inputs.fit.initial_outcome_probabilities.tolist()
    learned = inputs.fit.outcome_probabilities.tolist()
    rows = [
        (model, outcome, counts[m], initial[m][k], learned[m][k])
        for m, model in enumerate(inputs.problem.model_names)
        for k, outcome in enumerate(OUTCOME_LABELS)
    ]
    header = ["model", "outcome", "decisions_of_model"]
    return csv_text([*header, "initial_probability", "learned_probability"], rows)


def _map_figures(inputs: ReportInputs) -> dict[str, Figure]:
    """By their names in the template of the page."""
    scenario, problem = inputs.scenario, inputs.problem
    grid = problem.grid
    found: dict[str, Figure] = {}
    if inputs.knowledge is not None:
        found["gain"] = draw_gain(scenario, grid, inputs.knowledge.gain_nats)
    if inputs.snapshot is not None:
        found["hallway"] = draw_hallway(scenario, inputs.snapshot)
    if len(inputs.demonstrations):
        visits = state_counts(inputs.demonstrations, grid.n_states)
        found["visitation"] = draw_visitation(scenario, grid, visits, inputs.demonstration_tracks_m)
    if inputs.forecasts and (problem.flow != NO_FLOW).any():
        order = np.where(problem.flow != NO_FLOW, 1.0, 0.0)
        found["flow"] = draw_flow_map(grid, problem.flow, order, scenario=scenario)
    if inputs.familiarity is not None:
        compared = inputs.familiarity
        found["surprises"] = draw_surprises(grid, compared.decisions, compared.surprising, scenario)
    whose = "" if inputs.driven is None else " of the learned policy"
    policy, traps = inputs.policy, trapped_states(inputs)
    found["policy"] = draw_policy_map(
        scenario, grid, policy.value, policy.greedy, problem.goal_states, traps, whose
    )
    found["features"] = draw_features(
        scenario, grid, problem.features, problem.feature_names, problem.mdp.available
    )
    return found


def _chart_figures(inputs: ReportInputs) -> dict[str, Figure]:
    fit, problem, used = inputs.fit, inputs.problem, inputs.problem.used_models
    found: dict[str, Figure] = {}
    recorded_s = () if inputs.recorded is None else inputs.recorded.times_s
    if inputs.episodes:
        times_s = inputs.arrival_times_s
        found["arrival"] = draw_comparison(inputs.predicted, times_s, inputs.timeout_s, recorded_s)
    if inputs.forecasts:
        laws = {each.name: each.law for each in inputs.forecasts}
        found["forecast"] = draw_forecasts(laws, inputs.timeout_s, recorded_s)
    if len(fit.objective_trace):
        found["progress"] = draw_progress(fit.objective_trace, converged=fit.converged)
    return found | {
        "weights": draw_weights(fit.feature_names, fit.reward_weights),
        "outcomes": draw_outcomes(
            tuple(problem.model_names[m] for m in used),
            fit.initial_outcome_probabilities[used],
            fit.outcome_probabilities[used],
            known_decisions(inputs)[used],
            inputs.knowledge,
        ),
    }
