"""Which types of experts are found among mixed demonstrations, and what that is worth.

The gridworld of two terrains of `hidden_actions`. Experts of one to three types,
who differ in what they seek, demonstrate in one world. `choose_expert_types` searches the number of
types as `serd learn --experts auto` does; BIC and ICL choose among the mixtures that it fitted.
"""

from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.experiments.latent.hidden_actions import (
    TRUTH,
    HiddenActionsConfig,
    terrain_problem,
    uniform_starts,
)
from lab.experiments.running.experiment import Count, Findings, SeededConfig, Session, Sizes
from lab.experiments.running.statistics import StatisticsSettings, mean_interval
from lab.experiments.running.tables import Row
from lab.learner_curves import draw_points
from report import style
from report.figures.charts import draw_bars
from report.style import new_figure
from serd_app.demonstrations.decision_table import concatenate
from serd_core.arrays import FloatArray, IntArray, weighted_counts
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.errors import SerdError
from serd_core.mdp.problem import TabularProblem
from serd_core.mixtures.expert_types import (
    ExpertTypes,
    TypeChoice,
    choose_expert_types,
    fit_expert_types,
)
from serd_core.policies.solved_policy import soft_policy
from serd_core.selection.evaluation import adjusted_rand_index, move_log_likelihood
from storage.settings import setting

#: (3, 2) weights of the goal and of brightness, by type.
WEIGHTS: FloatArray = np.array([[4.0, 2.0], [4.0, -2.0], [-4.0, 0.0]])
CRITERIA = ("evidence", "bic", "icl")
#: What is averaged over repetitions, with its meaning.
MEASURES = {
    **{f"right_{name}": f"right number of types by {name}" for name in CRITERIA},
    "more_evidence": "too many types by evidence",
    "rand": "adjusted Rand index, number chosen by evidence",
    "rand_given": "adjusted Rand index, number given",
    "rand_known": "adjusted Rand index of the likeliest types under the true rewards and dynamics",
    "gain": "held-out log-likelihood per decision, mixture less one type",
    "gain_given": "the same, number given",
    "tried": "mixtures that the search fitted",
}
INTERVALS = StatisticsSettings(bootstrap=2000, coverage=0.95)


class MixedExpertsConfig(SeededConfig):
    """Experts of known types in random gridworlds of two terrains."""

    n_repetitions: int = setting(24, "worlds with demonstrations, drawn anew", ge=2)
    most_types: int = setting(3, "types of experts, from one up to this", ge=1, le=len(WEIGHTS))
    sizes: Sizes = setting((15, 60), "moves of each expert")
    n_experts: int = setting(24, "experts, shared out among the types", ge=6)
    n_held_out: Count = setting(24, "further experts, on whom mixtures are compared")
    side: Count = setting(8, "cells along each side", ge=3)
    longest: Count = setting(15, "moves of a demonstration")
    discount: float = setting(0.9, "discount per decision", ge=0, lt=1)


def run_mixed_experts(config: MixedExpertsConfig, session: Session) -> Findings:
    """What was chosen and found in each world, its means with intervals, and their picture."""
    table = session.repeat(partial(mix_in_one_world, config), config.n_repetitions, config)
    summary = summary_of(table, config.seed)
    files = {
        "mixtures.csv": table,
        "summary.csv": summary,
        "mixed_experts.png": mixed_experts_figure(table, summary),
    }
    return Findings(summary, files)


def mix_in_one_world(config: MixedExpertsConfig, number: int) -> list[Row]:
    """A row per true number of types and moves of each expert."""
    rng = np.random.default_rng([config.seed, number])
    here = HiddenActionsConfig(side=config.side, discount=config.discount)
    problem = terrain_problem(here, rng)
    rows = []
    for n_types in range(1, config.most_types + 1):
        for size in config.sizes:
            of_experts = np.arange(config.n_experts) % n_types
            of_others = np.arange(config.n_held_out) % n_types
            shown, others = (
                demonstrations(problem, types, size, config.longest, rng)
                for types in (of_experts, of_others)
            )
            begin: Row = {
                "repetition": number,
                "types": n_types,
                "moves": size,
                "rand_known": adjusted_rand_index(
                    likeliest_types(problem, *shown, n_types), of_experts
                ),
            }
            try:
                choice = choose_expert_types(problem, shown[0], experts=shown[1])
                given = _given(choice, problem, *shown, n_types)
            except SerdError as error:
                rows.append(begin | {"message": str(error)})
                continue
            rows.append(begin | _measures(choice, given, of_experts, others))
    return rows


def demonstrations(
    problem: TabularProblem, types: IntArray, size: int, longest: int, rng: np.random.Generator
) -> tuple[Decisions, IntArray]:
    """Those of experts of given types, `size` moves of each, and (N,) the expert of each."""
    mdp, starts, found, experts = problem.mdp, uniform_starts(problem.mdp), [], []
    policies = [soft_policy(problem, weights, TRUTH).probabilities for weights in WEIGHTS]
    n_episodes, n_steps = -(-size // longest), min(longest, size)
    for expert, each in enumerate(types):
        own = sample_decisions(
            mdp, policies[each], TRUTH, starts, n_episodes=n_episodes, n_steps=n_steps, rng=rng
        ).select(np.arange(size))
        found.append(replace(own, episode=own.episode + expert * n_episodes))
        experts.append(np.full(size, expert))
    return concatenate(found), np.concatenate(experts)


def likeliest_types(
    problem: TabularProblem, decisions: Decisions, experts: IntArray, n_types: int
) -> IntArray:
    """(E,) type of highest likelihood of each expert, where rewards and dynamics are known."""
    by_type = []
    for weights in WEIGHTS[:n_types]:
        policy = soft_policy(problem, weights, TRUTH).probabilities
        found = move_log_likelihood(problem, decisions, policy, TRUTH)
        by_type.append(weighted_counts(experts, found, int(experts.max()) + 1))
    return np.asarray(np.argmax(by_type, axis=0))


def _given(
    choice: TypeChoice,
    problem: TabularProblem,
    decisions: Decisions,
    experts: IntArray,
    n_types: int,
) -> ExpertTypes:
    """The mixture of the true number of types, fitted where the search ended before it."""
    if n_types <= len(choice.candidates):
        return choice.candidates[n_types - 1]
    return fit_expert_types(problem, decisions, n_types, experts=experts)


def _measures(
    choice: TypeChoice, given: ExpertTypes, types: IntArray, others: tuple[Decisions, IntArray]
) -> Row:
    tried, best = choice.candidates, choice.chosen
    chosen = {
        "evidence": best.n_types,
        "bic": max(tried, key=lambda each: each.bic).n_types,
        "icl": max(tried, key=lambda each: each.icl).n_types,
    }
    one, of_best, of_given = (
        each.unit_log_likelihoods(*others)[0].sum() / len(others[0])
        for each in (tried[0], best, given)
    )
    return {
        **{f"chosen_{name}": number for name, number in chosen.items()},
        **{f"right_{name}": float(number == given.n_types) for name, number in chosen.items()},
        "more_evidence": float(best.n_types > given.n_types),
        "rand": adjusted_rand_index(best.type_of_unit, types),
        "rand_given": adjusted_rand_index(given.type_of_unit, types),
        "gain": float(of_best - one),
        "gain_given": float(of_given - one),
        "tried": float(len(tried)),
        **{f"log_evidence_{each.n_types}": each.log_evidence for each in tried},
        "log_evidence_given": given.log_evidence,
        "fewest_episodes": float(best.n_episodes.min()),
        "converged": all(each.converged for each in (*tried, given)),
        "message": "",
    }


def summary_of(table: pd.DataFrame, seed: int = 0) -> pd.DataFrame:
    """Mean of each measure with its 95 % bootstrap interval, by types and moves.

    n: repetitions; failed: those without a fit, which are left out.
    """
    rows: list[Row] = []
    for (n_types, moves), chosen in table.groupby(["types", "moves"], sort=False):
        good = chosen[chosen["message"] == ""]
        rng = np.random.default_rng([seed, n_types, moves])
        for measure in MEASURES:
            mean = mean_interval(good[measure].to_numpy(dtype=np.float64), INTERVALS, rng)
            place: Row = {"types": n_types, "moves": moves, "measure": measure, "n": len(good)}
            rows.append(place | {"failed": len(chosen) - len(good)} | mean.columns("mean"))
    return pd.DataFrame(rows)


def mixed_experts_figure(table: pd.DataFrame, summary: pd.DataFrame) -> Figure:
    """How often each number of types is chosen; Rand index and held-out gain of every world."""
    good = table[table["message"] == ""]
    with style.report_style():
        figure = new_figure(10.8, 4.0)
        numbers, rand, gain = figure.subplots(1, 3, width_ratios=(1.25, 1.0, 1.0))
        _draw_right(numbers, summary)
        _draw_points(rand, good, summary, "rand")
        for (n_types, size), rows in good.groupby(["types", "moves"]):
            sizes = list(dict.fromkeys(good["moves"]))
            at = n_types + 0.3 * (sizes.index(size) - (len(sizes) - 1) / 2)
            label = "true rewards known, mean" if at < 1 else None
            ends, mean = [at - 0.13, at + 0.13], rows["rand_known"].mean()
            rand.plot(ends, [mean] * 2, color=style.INK, linestyle=":", label=label)
        rand.set_title("adjusted Rand index", loc="left")
        _draw_points(gain, good, summary, "gain")
        gain.axhline(0.0, color=style.MUTED, linewidth=0.8)
        gain.set_title("held-out nats per decision,\nmixture less one type", loc="left")
        for axes in (numbers, rand):
            handles, labels = axes.get_legend_handles_labels()
            axes.legend(handles, labels, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3)
    return figure


def _draw_right(axes: Axes, summary: pd.DataFrame) -> None:
    """Share of worlds in which each criterion chooses the true number, with intervals."""
    colours = dict(zip(CRITERIA, (style.BLUE, style.GREEN, style.MUTED), strict=True))
    labels = {"evidence": "evidence", "bic": "BIC", "icl": "ICL"}
    cases = list(dict.fromkeys(zip(summary["types"], summary["moves"], strict=True)))
    for place, name in enumerate(CRITERIA):
        rows = summary[summary["measure"] == f"right_{name}"]
        at = np.arange(len(cases)) + 0.25 * (place - 1)
        axes.bar(at, rows["mean"], width=0.22, color=colours[name], label=labels[name])
        ends = rows[["lower", "mean", "upper"]].to_numpy().T
        draw_bars(axes, at, ends, fmt="none", color=style.INK, lw=0.8)
    axes.set_xticks(range(len(cases)), [f"{types} × {moves}" for types, moves in cases], fontsize=8)
    axes.set_ylim(0, 1.05)
    axes.set_title("worlds with the right number\n(types × moves of an expert)", loc="left")
    axes.grid(axis="y")


def _draw_points(axes: Axes, table: pd.DataFrame, summary: pd.DataFrame, measure: str) -> None:
    """Every world as a point beside the mean."""
    sizes = list(dict.fromkeys(table["moves"]))
    colours = dict(zip(sizes, (style.BLUE, style.RED, style.GREEN, style.MUTED), strict=False))
    spread = np.random.default_rng(0)
    types = sorted(set(table["types"]))
    for place, size in enumerate(sizes):
        for n_types in types:
            rows = table[(table["types"] == n_types) & (table["moves"] == size)]
            at = n_types + 0.3 * (place - (len(sizes) - 1) / 2)
            beside = at + spread.uniform(-0.09, 0.09, len(rows))
            label = f"{size} moves" if n_types == types[0] else None
            draw_points(axes, beside, rows[measure], colours.get(size, style.INK), label)
            total = summary[
                (summary["types"] == n_types)
                & (summary["moves"] == size)
                & (summary["measure"] == measure)
            ].iloc[0]
            ends = total[["lower", "mean", "upper"]].to_numpy()[:, None]
            draw_bars(axes, [at], ends, fmt="_", color=style.INK, markersize=12, lw=1.2)
    axes.set_xticks(types, [f"{each} type{'s' if each > 1 else ''}" for each in types])
    axes.grid(axis="y")
