"""All figures of a report by name, in the order of the page."""

import numpy as np
from matplotlib.figure import Figure

from report.curves import measured_curve, predicted_curve, time_reaching
from report.figures.arrival import draw_arrival
from report.figures.features import draw_features
from report.figures.hallway import draw_hallway
from report.figures.outcomes import draw_outcomes
from report.figures.policy_map import draw_policy_map
from report.figures.progress import draw_progress
from report.figures.visitation import draw_visitation
from report.figures.weights import draw_weights
from report.inputs import ReportInputs
from report.layout import layout_of
from serd_core.arrays import BoolArray, IntArray
from serd_core.arrival.trap_states import trap_states
from serd_core.demonstrations.decisions import state_counts


def all_figures(inputs: ReportInputs) -> dict[str, Figure]:
    """Every figure of the report, keyed as in `report.captions`."""
    return _map_figures(inputs) | _chart_figures(inputs)


def trapped_states(inputs: ReportInputs) -> BoolArray:
    """(S,) states from which the greedy policy never arrives."""
    problem = inputs.problem
    return trap_states(problem.grid.neighbours, inputs.policy.greedy, problem.goal_states)


def decisions_per_model(inputs: ReportInputs) -> IntArray:
    """(M,) how many demonstrated decisions each outcome model is learned from."""
    model_of = inputs.problem.outcome_models.model_of
    used = model_of[inputs.demonstrations.state, inputs.demonstrations.action]
    return np.bincount(used, minlength=len(inputs.problem.model_names))


def _map_figures(inputs: ReportInputs) -> dict[str, Figure]:
    layout, problem = layout_of(inputs.scenario), inputs.problem
    grid = problem.grid
    visits = state_counts(inputs.demonstrations, grid.n_states)
    return {
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
    measured = measured_curve(inputs.episodes, inputs.timeout_s)
    return {
        "arrival": draw_arrival(
            predicted,
            measured,
            n_episodes=n_episodes,
            shown_until_s=_shown_until_s(inputs),
        ),
        "weights": draw_weights(fit.feature_names, fit.reward_weights),
        "outcomes": draw_outcomes(
            inputs.problem.model_names,
            fit.initial_outcome_probabilities,
            fit.outcome_probabilities,
            decisions_per_model(inputs),
        ),
        "progress": draw_progress(fit.objective_trace, converged=fit.converged),
    }


def _shown_until_s(inputs: ReportInputs) -> float:
    """Where the curves have flattened, or the timeout if somebody did not arrive."""
    if not all(row.arrived for row in inputs.episodes):
        return inputs.timeout_s
    latest = max(row.time_of_arrival_s or 0.0 for row in inputs.episodes)
    curve = predicted_curve(inputs.predicted, 1)
    settled = time_reaching(curve, 0.99 * float(curve.probability[-1])) or latest
    return min(inputs.timeout_s, 1.15 * max(latest, settled))
