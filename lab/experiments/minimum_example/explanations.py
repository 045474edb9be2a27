"""The minimum example (section 4.6.1, Figs. 4.8 and 4.9).

Two states, three actions; the expert always takes a in state 1. The outcome of b was never
observed, so the demonstrations have two explanations. SERD finds either, depending on its start;
IRL with the naive dynamics finds only the one that its prior for b implies.
"""

from functools import partial

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from lab.estimators.priors import NormPrior
from lab.experiments.running.experiment import Count, Findings, SeededConfig, Session, Sizes
from lab.experiments.running.tables import Row, quartiles
from lab.learner_curves import STYLES, draw_band, tick_sizes
from serd_app.report.style import HAIRLINE, INK, MUTED, new_figure
from serd_core.ascent.trust_region import TrustRegion
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.posterior.beliefs import Belief, FixedBelief, TiedBelief
from serd_core.posterior.parameters import Block
from serd_core.priors.prior import Prior
from serd_core.selection.evaluation import fitted_policy
from serd_files.settings import setting

FIRST, SECOND = 0, 1
A, B, C = 0, 1, 2
ASCENT = TrustRegion(gradient_tolerance=1e-9, max_steps=500)
LEARNERS: dict[str, Belief] = {"MDCE SERD": TiedBelief(), "MDCE IRL": FixedBelief()}
#: Weights beyond this either way are drawn in the outermost bins.
WIDEST = 60.0


class MinimumExampleConfig(SeededConfig):
    """Settings of section 4.6.1; the thesis does not state the discount."""

    n_sets: Count = setting(5_000, "demonstration sets, spread evenly over the sizes")
    sizes: Sizes = setting((1, 2, 3, 5, 8, 12, 20, 30, 50), "demonstrations of a set")
    horizon: Count = setting(3, "decisions of a demonstration")
    discount: float = setting(0.9, "discount per decision", ge=0, lt=1)
    weight: float = setting(1e-6, "of the L2 norms of rewards and dynamics", ge=0)


def run_minimum_example(config: MinimumExampleConfig, session: Session) -> Findings:
    """Estimates of both learners, and quartiles of the log-likelihood."""
    table = all_estimates(config, session)
    by = ["learner", "mode", "size"]
    summary = quartiles(table, "log_likelihood", by).sort_values(by)
    files = {
        "estimates.csv": table,
        "log_likelihood.csv": summary,
        "estimates.png": estimates_figure(table),
        "log_likelihood.png": likelihood_figure(table),
    }
    return Findings(summary, files)


def all_estimates(config: MinimumExampleConfig, session: Session) -> pd.DataFrame:
    """One row per demonstration set and learner."""
    sets_per_repetition = 50
    n_repetitions = -(-config.n_sets // sets_per_repetition)
    return session.repeat(partial(fit_sets, config, sets_per_repetition), n_repetitions, config)


def fit_sets(config: MinimumExampleConfig, n_sets: int, number: int) -> list[Row]:
    """Rows of the sets that belong to one repetition."""
    last = min((number + 1) * n_sets, config.n_sets)
    return [row for index in range(number * n_sets, last) for row in fit_one_set(config, index)]


def fit_one_set(config: MinimumExampleConfig, index: int) -> list[Row]:
    """Sample one set, start both learners at the same random weight."""
    rng = np.random.default_rng([config.seed, index])
    problem = minimum_example(config.discount)
    size = config.sizes[index % len(config.sizes)]
    decisions = demonstrate(problem, size, config.horizon, rng)
    weight = rng.uniform(-10.0, 10.0, 1)
    rows = []
    for name, belief in LEARNERS.items():
        fit = fit_mdce_serd(
            problem,
            decisions,
            initial_weights=weight,
            belief=belief,
            prior=prior_of(config),
            ascent=ASCENT,
        )
        rows.append(_row(problem, name, index, size, fit))
    return rows


def prior_of(config: MinimumExampleConfig) -> Prior:
    """L2 norms of rewards and dynamics."""
    return NormPrior(config.weight, Block.REWARD) + NormPrior(config.weight, Block.TRUTH)


def minimum_example(discount: float) -> TabularProblem:
    """Figure 4.2 with one outcome model per action in state 1, features -1 and +1."""
    successors = np.zeros((2, 3, 2), dtype=np.int64)
    successors[FIRST, [A, B]] = [FIRST, SECOND]
    successors[SECOND, C] = SECOND
    available = np.array([[True, True, False], [False, False, True]])
    models = OutcomeModels(successors, np.array([[A, B, A]] * 2), available, n_models=2)
    features = np.array([-1.0, 1.0])[:, None, None] * np.ones((2, 3, 1))
    return TabularProblem(Mdp(models, discount), features, ("state",))


def demonstrate(
    problem: TabularProblem, size: int, horizon: int, rng: np.random.Generator
) -> Decisions:
    """Episodes of an expert who takes a in state 1, where it moves on with probability 2/3.

    Steps in state 2, where c is the only action, carry no information and are left out.
    """
    return sample_decisions(
        problem.mdp,
        np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        np.array([[1 / 3, 2 / 3], [0.5, 0.5]]),
        np.array([1.0, 0.0]),
        n_episodes=size,
        n_steps=horizon,
        rng=rng,
    )


def estimates_figure(table: pd.DataFrame) -> Figure:
    """Fig. 4.8: estimated transition models, and densities of the learned weights."""
    figure = new_figure(8.6, 4.0)
    dynamics, weights = figure.subplots(1, 2)
    for learner, chosen in table.groupby("learner", sort=False):
        colour = STYLES[learner].colour
        by_a, by_b = chosen["moves_on_a"], chosen["moves_on_b"]
        dynamics.plot(by_a, by_b, ".", color=colour, alpha=0.25, markersize=4, label=learner)
        inside, limits = chosen["weight"].clip(-WIDEST, WIDEST), (-WIDEST, WIDEST)
        weights.hist(
            inside, bins=60, range=limits, density=True, color=colour, alpha=0.55, label=learner
        )
    dynamics.plot([0, 1], [0, 1], "--", color=MUTED, linewidth=1)
    dynamics.set(xlabel="P(2 | 1, a)", ylabel="P(2 | 1, b)", title="estimated dynamics")
    dynamics.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02), aspect="equal")
    for text, height in (("mode A: state 2 is avoided", 0.82), ("mode B: state 2 is sought", 0.1)):
        dynamics.text(0.5, height, text, color=INK, ha="center", fontsize="small")
    dynamics.text(0.5, 0.53, "given to IRL", color=INK, ha="right", fontsize="small")
    weights.set(xlabel=f"reward weight (beyond {WIDEST:.0f}: at the edge)", ylabel="density")
    weights.set(title="estimated reward")
    weights.legend(frameon=False)
    return figure


def likelihood_figure(table: pd.DataFrame) -> Figure:
    """Fig. 4.9: median and quartiles of the log-likelihood by size, SERD split by mode.

    The axis is logarithmic and shows the negative, so lower is better.
    """
    figure = new_figure(6.0, 3.8)
    axes = figure.subplots()
    is_serd = table["learner"] == "MDCE SERD"
    learner = table["learner"].where(~is_serd, "MDCE SERD, mode " + table["mode"])
    for name in sorted(learner.unique(), key=list(STYLES).index):
        curve = quartiles(table[learner == name], "log_likelihood", ["size"]).sort_values("size")
        draw_band(axes, curve["size"], -curve[["median", "lower", "upper"]], name)
    axes.set(xlabel="demonstrations", ylabel="minus log-likelihood of the choice", xscale="log")
    axes.set_yscale("log")
    tick_sizes(axes, sorted(table["size"].unique()))
    axes.grid(color=HAIRLINE, linewidth=0.6)
    axes.legend(frameon=False)
    return figure


def _row(problem: TabularProblem, name: str, index: int, size: int, fit: FitResult) -> Row:
    by_a, by_b = fit.outcome_probabilities[:, SECOND]
    policy = fitted_policy(problem, fit)
    return {
        "set": index,
        "size": size,
        "learner": name,
        "moves_on_a": float(by_a),
        "moves_on_b": float(by_b),
        "weight": float(fit.reward_weights[0]),
        # MDP B of Fig. 4.7: state 2 is the better one and a leads there more often.
        "mode": "B" if fit.reward_weights[0] > 0 else "A",
        "log_likelihood": float(np.log(max(policy[FIRST, A], np.finfo(np.float64).tiny))),
        "converged": fit.converged,
    }
