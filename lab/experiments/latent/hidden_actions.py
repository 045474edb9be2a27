"""What states alone reveal: rewards and dynamics from demonstrations whose actions are hidden.

A gridworld of two terrains, in which one outcome model per terrain moves relative to the chosen
direction. The same demonstrations are learned with all actions, with those of a share of the
episodes, and without any.
"""

from functools import partial

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.experiments.running.experiment import Count, Findings, SeededConfig, Session, Sizes
from lab.experiments.running.tables import Row
from lab.learner_curves import draw_points
from serd_app.report import style
from serd_app.report.style import Look, new_figure
from serd_core.arrays import FloatArray
from serd_core.bayes.draws import credible_intervals, laplace_draws
from serd_core.bayes.laplace import laplace
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.grid.grid import Action, Grid, Outcome
from serd_core.grid.navigation import outcome_successors
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.solved_policy import soft_policy
from serd_files.settings import setting

MOVES = (Action.NORTH, Action.EAST, Action.SOUTH, Action.WEST)
TERRAINS = ("open", "forest")
#: (2, 5) probabilities to stay, and to move forward, right, back and left of the direction.
TRUTH: FloatArray = np.array([[0.04, 0.74, 0.10, 0.02, 0.10], [0.29, 0.31, 0.175, 0.05, 0.175]])
WEIGHTS: FloatArray = np.array([4.0, 2.0])
FEATURES = ("goal", "brightness")
KINDS = ("shown", "a fifth shown", "hidden")
MASS, N_DRAWS = 0.9, 2000
_COLOURS = dict(zip(KINDS, (style.MUTED, style.GREEN, style.BLUE), strict=True))
_LABELS = {
    "goal": "weight of the goal",
    "brightness": "weight of the brightness",
    "open": "P(forward) on open ground",
    "forest": "P(forward) in the forest",
}


class HiddenActionsConfig(SeededConfig):
    """Demonstrators in a random gridworld of two terrains."""

    n_repetitions: Count = setting(50, "worlds with demonstrations, drawn anew")
    sizes: Sizes = setting((900, 4500), "moves")
    side: Count = setting(10, "cells along each side", ge=3)
    longest: Count = setting(15, "moves of a demonstration")
    discount: float = setting(0.9, "discount per decision", ge=0, lt=1)


def run_hidden_actions(config: HiddenActionsConfig, session: Session) -> Findings:
    """Estimates with intervals, their bias, and how often the intervals hold the truth."""
    table = session.repeat(partial(learn_one_world, config), config.n_repetitions, config)
    summary = summary_of(table)
    files = {
        "estimates.csv": table,
        "summary.csv": summary,
        "hidden_actions.png": hidden_actions_figure(table, summary),
    }
    return Findings(summary, files)


def terrain_problem(config: HiddenActionsConfig, rng: np.random.Generator) -> TabularProblem:
    """Cells of random brightness, the darker half of which are forest; a goal at the top."""
    side = config.side
    grid = Grid((0.0, 0.0), 1.0, np.ones((side, side), np.bool_))
    brightness = rng.random(grid.n_states)
    available = np.ones((grid.n_states, len(MOVES)), np.bool_)
    models = OutcomeModels(
        successors=outcome_successors(grid, np.broadcast_to(MOVES, available.shape)),
        model_of=np.where(available & (brightness < 0.5)[:, None], 1, 0),
        available=available,
        n_models=len(TERRAINS),
        intended=np.full(len(TERRAINS), int(Outcome.FORWARD)),
    )
    features = np.zeros((*available.shape, len(FEATURES)))
    features[grid.state_of_cell[side - 1, side // 2], :, 0] = 1.0
    features[:, :, 1] = brightness[:, None]
    return TabularProblem(Mdp(models, config.discount), features, FEATURES)


def learn_one_world(config: HiddenActionsConfig, number: int) -> list[Row]:
    """Rows of one repetition: every size and kind, each set a part of the next."""
    rng = np.random.default_rng([config.seed, number])
    problem = terrain_problem(config, rng)
    mdp, n_steps, n_episodes = problem.mdp, config.longest, -(-max(config.sizes) // config.longest)
    policy, starts = soft_policy(problem, WEIGHTS, TRUTH).probabilities, uniform_starts(mdp)
    decisions = sample_decisions(
        mdp, policy, TRUTH, starts, n_episodes=n_episodes, n_steps=n_steps, rng=rng
    )
    rows = []
    for size in config.sizes:
        chosen = decisions.select(np.arange(size))
        for kind in KINDS:
            here = {"repetition": number, "size": size, "kind": kind}
            rows += [here | row for row in _estimates(problem, with_actions(chosen, kind))]
    return rows


def uniform_starts(mdp: Mdp) -> FloatArray:
    """(S,) each state as likely."""
    return np.full(mdp.n_states, 1.0 / mdp.n_states)


def with_actions(decisions: Decisions, kind: str) -> Decisions:
    """The decisions with the actions of all, of every fifth, or of no episode."""
    hidden = {
        "shown": np.zeros(len(decisions), dtype=np.bool_),
        "a fifth shown": decisions.episode % 5 != 0,
        "hidden": np.ones(len(decisions), dtype=np.bool_),
    }
    return decisions.with_hidden_actions(hidden[kind])


def _estimates(problem: TabularProblem, decisions: Decisions) -> list[Row]:
    truth = [*WEIGHTS, *TRUTH[:, Outcome.FORWARD]]
    names = [*FEATURES, *TERRAINS]
    try:
        fit = fit_mdce_serd(problem, decisions)
        draws = laplace_draws(laplace(problem, decisions, fit), np.random.default_rng(0), N_DRAWS)
    except SerdError as error:
        return [{"number": name, "converged": False, "message": str(error)} for name in names]
    found = credible_intervals(draws, MASS)
    estimate = [*fit.reward_weights, *fit.outcome_probabilities[:, Outcome.FORWARD]]
    lower, upper = (
        [*rewards, *outcomes[:, Outcome.FORWARD]]
        for rewards, outcomes in zip(found.reward, found.outcome_probabilities, strict=True)
    )
    columns = {"truth": truth, "estimate": estimate, "lower": lower, "upper": upper}
    table = pd.DataFrame({"number": names} | columns).astype(dict.fromkeys(columns, float))
    rows: list[Row] = table.assign(converged=fit.converged, message=fit.message).to_dict("records")
    return rows


def summary_of(table: pd.DataFrame) -> pd.DataFrame:
    """One row per number, size and kind, over the repetitions that converged.

    bias: mean of the estimates less the truth, with its standard error; width: of the intervals;
    coverage: share of them that hold the truth.
    """
    rows: list[Row] = []
    for (name, size, kind), chosen in table.groupby(["number", "size", "kind"], sort=False):
        good = chosen[chosen["converged"]]
        error = good["estimate"] - good["truth"]
        holds = (good["lower"] <= good["truth"]) & (good["truth"] <= good["upper"])
        rows.append(
            {
                "number": name,
                "size": size,
                "kind": kind,
                "n": len(good),
                "failed": len(chosen) - len(good),
                "bias": float(error.mean()),
                "bias_error": float(error.std() / np.sqrt(max(len(good), 1))),
                "rmse": float(np.sqrt(np.mean(error**2))),
                "width": float((good["upper"] - good["lower"]).mean()),
                "coverage": float(holds.mean()),
            }
        )
    return pd.DataFrame(rows)


def hidden_actions_figure(table: pd.DataFrame, summary: pd.DataFrame) -> Figure:
    """Estimates of every repetition by size and kind, one panel per number."""
    with style.report_style():
        figure = new_figure(9.6, 6.4)
        for axes, name in zip(figure.subplots(2, 2).ravel(), _LABELS, strict=True):
            rows, totals = (each[each["number"] == name] for each in (table, summary))
            _draw_estimates(axes, rows[rows["converged"]], totals)
            axes.set_title(_LABELS[name], loc="left")
        handles, labels = axes.get_legend_handles_labels()
        title = f"per cent: {100 * MASS:.0f} % intervals that hold the truth; bars: means"
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), title=title)
    return figure


def _draw_estimates(axes: Axes, rows: pd.DataFrame, totals: pd.DataFrame) -> None:
    """Points beside their mean; above them the coverage of the intervals."""
    sizes = list(dict.fromkeys(rows["size"]))
    spread, truth = np.random.default_rng(0), rows["truth"].iloc[0]
    axes.axhline(truth, color=style.RED, linestyle="--", linewidth=1.2, label="truth")
    on_top: Look = {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "top"}
    for place, kind in enumerate(KINDS):
        for number, size in enumerate(sizes):
            at = number + 0.27 * (place - 1)
            found = rows[(rows["size"] == size) & (rows["kind"] == kind)]["estimate"]
            beside = at + spread.uniform(-0.07, 0.07, len(found))
            label = f"actions {kind}" if kind != KINDS[1] else "actions of a fifth of the episodes"
            draw_points(axes, beside, found, _COLOURS[kind], label if number == 0 else None)
            axes.plot([at - 0.1, at + 0.1], [found.mean()] * 2, color=_COLOURS[kind], linewidth=2.5)
            total = totals[(totals["size"] == size) & (totals["kind"] == kind)].iloc[0]
            axes.annotate(f"{100 * total['coverage']:.0f} %", (at, 0.97), fontsize=7.5, **on_top)
    low, high = rows["estimate"].min(), rows["estimate"].max()
    axes.set_ylim(low - 0.05 * (high - low), high + 0.18 * (high - low))
    axes.set_xticks(range(len(sizes)), [f"{size} moves" for size in sizes])
    axes.grid(axis="y")
