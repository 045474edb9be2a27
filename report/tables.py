"""The report's numbers as CSV text: one header line, one row per line, full precision."""

from dataclasses import astuple, fields

import numpy as np

from report.curves import at_times, measured_curve, predicted_curve
from report.episode_row import EpisodeRow
from report.figure_set import decisions_per_model
from report.figures.outcomes import OUTCOME_LABELS
from report.inputs import ReportInputs
from storage.table import csv_text


def all_tables(inputs: ReportInputs) -> dict[str, str]:
    """CSV text by file name."""
    return {
        "episodes.csv": episodes_table(inputs.episodes),
        "arrival_times.csv": arrival_table(inputs),
        "reward_weights.csv": weights_table(inputs),
        "outcome_models.csv": outcomes_table(inputs),
    }


def episodes_table(episodes: tuple[EpisodeRow, ...]) -> str:
    """One row per episode; time_of_arrival_s is empty unless the robot arrived."""
    return csv_text([field.name for field in fields(EpisodeRow)], map(astuple, episodes))


def arrival_table(inputs: ReportInputs) -> str:
    """Both curves with their bands at every time at which one of them steps."""
    n_episodes = len(inputs.episodes)
    predicted = predicted_curve(inputs.predicted, n_episodes)
    measured = measured_curve(inputs.episodes, inputs.timeout_s)
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
    counts = decisions_per_model(inputs).tolist()
    initial = inputs.fit.initial_outcome_probabilities.tolist()
    learned = inputs.fit.outcome_probabilities.tolist()
    rows = [
        (model, outcome, counts[m], initial[m][k], learned[m][k])
        for m, model in enumerate(inputs.problem.model_names)
        for k, outcome in enumerate(OUTCOME_LABELS)
    ]
    header = ["model", "outcome", "decisions_of_model"]
    return csv_text([*header, "initial_probability", "learned_probability"], rows)
