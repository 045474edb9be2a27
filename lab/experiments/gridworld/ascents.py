"""Optimisers compared on one SERD fit of the gridworld.

Line 9 of Algorithm 1 is plain gradient ascent, theta <- theta + alpha grad J. L-BFGS and the trust
region climb the same objective from the same start.
"""

import time
from typing import Literal

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from lab.estimators.gradient_ascent import GradientAscent
from lab.experiments.gridworld.experiment import GridworldConfig, demonstrate, scenes
from lab.experiments.running.experiment import Count, Findings, SeededConfig, Session
from lab.experiments.running.tables import Row
from serd_app.report.style import BLUE, PURPLE, RED, new_figure, report_style
from serd_core.ascent.ascent import Ascent, Lbfgs
from serd_core.ascent.trust_region import TrustRegion
from serd_core.learners.serd import fit_mdce_serd
from serd_core.posterior.parameters import Block
from serd_core.priors.divergence import KldPrior
from serd_core.priors.prior import GaussianPrior
from serd_files.settings import setting, setting_of

AscentName = Literal["gradient", "lbfgs", "trust-region"]
LOOKS: dict[AscentName, tuple[str, str]] = {
    "gradient": (RED, "-"),
    "lbfgs": (PURPLE, "--"),
    "trust-region": (BLUE, "-."),
}
#: With it the objective has one finite maximum.
PRIOR = KldPrior(0.1) + GaussianPrior(10.0, Block.REWARD)


class AscentsConfig(SeededConfig):
    """Settings of the comparison of optimisers."""

    side: int = setting_of(GridworldConfig, "side", default=5)
    n_demonstrations: Count = setting(20, "demonstrations learned from")
    n_steps: int = setting_of(GridworldConfig, "n_steps")
    gradient_tolerance: float = setting(1e-6, "largest gradient entry at which a fit ends", gt=0)
    max_steps: Count = setting(20_000, "steps after which a fit ends without convergence")
    step_size: float = setting(1.0, "alpha of gradient ascent, on the objective per decision", gt=0)


def make_ascent(
    name: AscentName, gradient_tolerance: float, max_steps: int, step_size: float = 1.0
) -> Ascent:
    """The optimiser of that name; step_size: of gradient ascent alone."""
    if name == "gradient":
        return GradientAscent(lambda _: step_size, gradient_tolerance, max_steps)
    make = Lbfgs if name == "lbfgs" else TrustRegion
    return make(gradient_tolerance=gradient_tolerance, max_steps=max_steps)


def run_ascents(config: AscentsConfig, session: Session) -> Findings:
    """The cost of each optimiser, and its objective by step; one after the other for the timing."""
    costs, traces = [], {}
    for number, name in enumerate(LOOKS):
        session.progress(number, len(LOOKS))
        cost, traces[name] = climb(config, name)
        costs.append(cost)
    session.progress(len(LOOKS), len(LOOKS))
    table = pd.DataFrame(costs)
    trace = pd.concat(traces, names=["ascent", "step"]).reset_index()
    trace["gap"] = table["objective"].max() - trace.pop("objective")
    files = {"costs.csv": table, "gaps.csv": trace, "gaps.png": gaps_figure(trace)}
    return Findings(table, files)


def climb(config: AscentsConfig, name: AscentName) -> tuple[Row, pd.DataFrame]:
    """What one optimiser costs, and its objective after each step."""
    sizes = GridworldConfig(side=config.side, n_steps=config.n_steps, seed=config.seed)
    scene, _ = scenes(sizes)
    rng = np.random.default_rng([config.seed, 1])
    n_episodes, n_steps = config.n_demonstrations, config.n_steps
    decisions = demonstrate(scene.world, scene.policy, n_episodes, n_steps, rng)
    began_s = time.perf_counter()
    fit = fit_mdce_serd(
        scene.world.problem,
        decisions,
        initial_weights=np.zeros(2),
        prior=PRIOR,
        ascent=make_ascent(name, config.gradient_tolerance, config.max_steps, config.step_size),
    )
    row: Row = {
        "ascent": name,
        "n_steps": fit.n_steps,
        "n_evaluations": fit.n_evaluations,
        "seconds": time.perf_counter() - began_s,
        "objective": fit.objective,
        "gradient_norm": fit.gradient_norm,
        "converged": fit.converged,
    }
    steps = pd.RangeIndex(1, len(fit.objective_trace) + 1)
    return row, pd.DataFrame({"objective": fit.objective_trace}, index=steps)


def gaps_figure(table: pd.DataFrame) -> Figure:
    """Distance to the highest objective found, by step."""
    with report_style():
        figure = new_figure(5.6, 3.6)
        axes = figure.subplots()
        for name, curve in table.groupby("ascent", sort=False):
            colour, line = LOOKS[name]
            positive = curve[curve["gap"] > 0]
            axes.loglog(positive["step"], positive["gap"], line, color=colour, label=name)
        axes.set(xlabel="step", ylabel="log posterior below the highest found")
        axes.grid(visible=True)
        axes.legend()
    return figure
