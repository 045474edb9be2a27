"""What choices reveal of a move that is avoided: the populated hallway in the decision problem.

Demonstrators plan by a soft policy with the dynamics that the hallway study measured, so they know
how rarely a move against the flow succeeds. What they avoid informs about that, as far as no reward
explains the same: the social norm does. Three combinations of expert and learner show both.
"""

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import beta

from lab.experiments.running.experiment import Count, Findings, SeededConfig, Session, Sizes
from lab.experiments.running.tables import Row, quantile, read_table
from lab.learner_curves import tick_sizes
from serd_app.navigation.strategy import start_distribution
from serd_app.report import style
from serd_app.report.figures.charts import draw_bars
from serd_app.report.style import new_figure
from serd_core.arrays import FloatArray
from serd_core.bayes.information import OutcomeInformation, outcome_information
from serd_core.bayes.laplace import laplace
from serd_core.bayes.strengths import strengths_of
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.errors import SerdError
from serd_core.grid.grid import Outcome
from serd_core.grid.navigation import AGAINST_FLOW, FEATURE_NAMES, NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import fit_mdce_serd
from serd_core.policies.solved_policy import soft_policy
from serd_files.settings import setting
from serd_sim.scenario.grid import navigation_problem_of
from serd_sim.scenario.scenario import load_scenario

#: From the results of the hallway study.
MEASURED = Path(__file__).parent / "hallway_dynamics.csv"
GOAL, NORM, WALL = FEATURE_NAMES
#: Features of the expert's reward and of the learner's.
CASES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "no norm": ((GOAL, WALL), (GOAL, WALL)),
    "norm": ((GOAL, NORM, WALL), (GOAL, NORM, WALL)),
    "norm assumed": ((GOAL, WALL), (GOAL, NORM, WALL)),
}
TITLES = {
    "no norm": "no norm in the reward,\nas the learner knows",
    "norm": "norm in the reward,\nits weight to be learned",
    "norm assumed": "no norm in the reward,\nbut the learner admits one",
}
MASS = 0.9
ENDS = ("lower", "median", "upper")
#: Of information, in nats.
SOURCES = ("from_transitions", "from_choices", "shared")
#: Of columns about the posterior, and about counts alone.
_PREFIXES = ("", "counted_")
OUTCOME = Outcome.FORWARD


class AvoidanceConfig(SeededConfig):
    """Demonstrators in the gridded hallway with measured dynamics."""

    n_repetitions: Count = setting(100, "sets of demonstrations, drawn anew")
    sizes: Sizes = setting((1, 5, 20), "demonstrations of a set")
    people: Count = setting(80, "people in the hallway, as in the hallway study")
    goal_weight: float = setting(4.0, "of the goal in the expert's reward")
    norm_weight: float = setting(1.0, "of the social norm, where the expert has it")
    wall_weight: float = setting(-0.2, "of the inverse distance to the wall")
    discount: float = setting(0.99, "discount per decision", ge=0, lt=1)
    longest: Count = setting(210, "decisions of a demonstration")

    def weights(self, features: tuple[str, ...]) -> FloatArray:
        """Of the expert's reward, by feature."""
        given = {GOAL: self.goal_weight, NORM: self.norm_weight, WALL: self.wall_weight}
        return np.array([given[name] for name in features])


def run_avoidance(config: AvoidanceConfig, session: Session) -> Findings:
    """Posteriors of moving against the flow, and how often their intervals hold the truth."""
    table = session.repeat(partial(learn_one_set, config), config.n_repetitions, config)
    summary = summary_of(table)
    files = {
        "posteriors.csv": table,
        "summary.csv": summary,
        "avoidance.png": avoidance_figure(table, summary),
    }
    return Findings(summary, files)


def measured_dynamics() -> FloatArray:
    """(M, K) outcome probabilities that the hallway study measured."""
    names = [outcome.name.lower() for outcome in Outcome]
    found: FloatArray = read_table(MEASURED)[names].to_numpy()
    return found


def learn_one_set(config: AvoidanceConfig, number: int) -> list[Row]:
    """Rows of one repetition: every case and size, each set a part of the next."""
    rows = []
    for place, (case, (expert, learner)) in enumerate(CASES.items()):
        rng = np.random.default_rng([config.seed, number, place])
        demonstrations = demonstrate(config, expert, rng)
        problem = hallway(config, learner)
        for size in config.sizes:
            chosen = demonstrations.select_episodes(range(size))
            rows.append({"case": case, "repetition": number, "size": size} | _row(problem, chosen))
    return rows


def hallway(config: AvoidanceConfig, features: tuple[str, ...]) -> NavigationProblem:
    """The decision problem of the hallway with these features."""
    scenario = load_scenario("hallway").with_pedestrian_count(config.people)
    return navigation_problem_of(scenario, config.discount, features)


def demonstrate(
    config: AvoidanceConfig, features: tuple[str, ...], rng: np.random.Generator
) -> Decisions:
    """Episodes of an expert who knows the measured dynamics."""
    problem, truth = hallway(config, features), measured_dynamics()
    return sample_decisions(
        problem.mdp,
        soft_policy(problem, config.weights(features), truth).probabilities,
        truth,
        start_distribution(load_scenario("hallway"), "train"),
        n_episodes=max(config.sizes),
        n_steps=config.longest,
        rng=rng,
    )


def summary_of(table: pd.DataFrame) -> pd.DataFrame:
    """One row per case and size: means over the repetitions that converged, and coverage.

    moves: against the flow; width: of the interval; counted_width: of counts alone; coverage: share
    of intervals that hold the truth; from_choices, shared: nats.
    """
    rows: list[Row] = []
    for (case, size), chosen in table.groupby(["case", "size"], sort=False):
        good = chosen[chosen["converged"]]
        low, middle, high = ({kind: good[f"{kind}{end}"] for kind in _PREFIXES} for end in ENDS)
        row: Row = {"case": case, "size": size, "n": len(good), "failed": len(chosen) - len(good)}
        row["moves"] = float(good["moves"].mean())
        for kind, values in middle.items():
            row[f"{kind}median"] = quantile(values.to_numpy(), 0.5)
        for kind in _PREFIXES:
            row[f"{kind}width"] = float((high[kind] - low[kind]).mean())
        for kind in _PREFIXES:
            holds = (low[kind] <= good["truth"]) & (good["truth"] <= high[kind])
            row[f"{kind}coverage"] = float(holds.mean())
        rows.append(row | {name: float(good[name].mean()) for name in SOURCES})
    return pd.DataFrame(rows)


def _row(problem: NavigationProblem, decisions: Decisions) -> Row:
    truth = float(measured_dynamics()[AGAINST_FLOW, OUTCOME])
    try:
        fit = fit_mdce_serd(problem, decisions)
        known = outcome_information(laplace(problem, decisions, fit), MASS)
    except SerdError as error:
        return {"truth": truth, "converged": False, "message": str(error)}
    return {
        "truth": truth,
        **forward_against_flow(fit, known),
        **_counted_quantiles(problem, decisions, fit),
        **{name: float(getattr(known, name)[AGAINST_FLOW]) for name in SOURCES},
        "partner": problem.feature_names[known.partner[AGAINST_FLOW]],
    }


def forward_against_flow(fit: FitResult, known: OutcomeInformation) -> Row:
    """How a fit ended, moves against the flow that it saw, and the interval of P(forward)."""
    return {
        "converged": fit.converged,
        "message": fit.message,
        "moves": float(known.n_decisions[AGAINST_FLOW]),
        **{end: float(getattr(known, end)[AGAINST_FLOW, OUTCOME]) for end in ENDS},
    }


def _counted_quantiles(problem: NavigationProblem, decisions: Decisions, fit: FitResult) -> Row:
    """Of P(outcome) under counts alone, with the pseudo-count of the fit.

    An observed move that several outcomes explain counts for each in equal shares.
    """
    assert fit.assumptions is not None
    pseudo = strengths_of(fit.assumptions.prior, problem)["pseudo_count"]
    models = problem.outcome_models
    chosen = models.model_of[decisions.state, decisions.action] == AGAINST_FLOW
    state, action, following = (
        each[chosen] for each in (decisions.state, decisions.action, decisions.next_state)
    )
    explains = models.successors[state, action] == following[:, None]
    counts = np.sum(explains / explains.sum(axis=1, keepdims=True), axis=0) + pseudo
    own = counts[OUTCOME]
    shares = [(1 - MASS) / 2, 0.5, (1 + MASS) / 2]
    found = beta.ppf(shares, own, counts.sum() - own)
    return {f"counted_{end}": float(each) for end, each in zip(ENDS, found, strict=True)}


def avoidance_figure(table: pd.DataFrame, summary: pd.DataFrame) -> Figure:
    """Per case: intervals of the posterior and of counts alone; information; coverage."""
    with style.report_style():
        figure = new_figure(3.6 * len(CASES), 6.6)
        panels = figure.subplots(2, len(CASES), sharex=True, sharey="row")
        for column, case in zip(panels.T, CASES, strict=True):
            rows, totals = (each[each["case"] == case] for each in (table, summary))
            _draw_posterior(column[0], rows[rows["converged"]], totals)
            column[0].set_title(TITLES[case], loc="left")
            _draw_information(column[1], totals)
            column[1].set_xlabel("demonstrations")
        panels[0, 0].set_ylabel("P(forward | against the flow)")
        panels[1, 0].set_ylabel("nats about the moves against the flow")
        shown = [row[0].get_legend_handles_labels() for row in panels]
        (above, names), (below, others) = shown
        figure.legend(above + below, names + others, loc="outside lower center", ncols=3)
    return figure


_KINDS = (
    ("counts alone", "counted_", style.MUTED, "s", -0.5),
    ("counts and choices (SERD)", "", style.BLUE, "o", 0.5),
)


def _draw_posterior(axes: Axes, rows: pd.DataFrame, totals: pd.DataFrame) -> None:
    """Means over the repetitions of the median and of both ends of the interval; coverage."""
    means = rows.groupby("size")[[f"{kind}{end}" for kind in _PREFIXES for end in ENDS]].mean()
    sizes = means.index.to_numpy(np.float64)
    truth = float(rows["truth"].iloc[0])
    axes.axhline(truth, color=style.GREEN, linestyle="--", linewidth=1.2, label="measured truth")
    for label, kind, colour, marker, shift in _KINDS:
        ends = means[[f"{kind}{end}" for end in ENDS]].to_numpy().T
        look = {"color": colour, "marker": marker, "markersize": 4.5, "linestyle": "none"}
        look |= {"capsize": 2, "label": f"{label}, {100 * MASS:.0f} % interval"}
        draw_bars(axes, sizes * 1.1**shift, ends, **look)
    axes.text(
        0.02, 0.95, "SERD's intervals that hold the truth:", transform=axes.transAxes, fontsize=7.5
    )
    for size, coverage in zip(totals["size"], totals["coverage"], strict=True):
        axes.text(size, 0.88, f"{100 * coverage:.0f} %", ha="center", fontsize=7.5)
    axes.set(xscale="log", ylim=(0, 1))
    tick_sizes(axes, means.index.tolist())
    axes.grid(axis="y")


def _draw_information(axes: Axes, totals: pd.DataFrame) -> None:
    """Means over the repetitions of the nats by source."""
    sizes = totals["size"].to_numpy(np.float64)
    looks = (
        ("from counts", style.MUTED, "-s"),
        ("from choices", style.BLUE, "-o"),
        ("shared with the reward weights", style.RED, "--^"),
    )
    for name, (label, colour, line) in zip(SOURCES, looks, strict=True):
        axes.plot(sizes, totals[name], line, color=colour, markersize=4.5, label=label)
    axes.set_ylim(bottom=0.0)
    axes.grid(axis="y")
