"""Optimisers compared on one SERD fit of the gridworld.

Line 9 of Algorithm 1 is plain gradient ascent, theta <- theta + alpha grad J. L-BFGS and the trust
region climb the same objective from the same start.
"""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.gridworld.experiment import GridworldConfig, demonstrate, scenes
from experiments.running.repetitions import Progress
from experiments.running.settings import setting
from experiments.running.tables import Row, write_table
from report.style import BLUE, PURPLE, RED, new_figure, png_bytes, report_style
from serd_core.ascent.ascent import Ascent
from serd_core.ascent.gradient_ascent import GradientAscent
from serd_core.ascent.lbfgs import Lbfgs
from serd_core.ascent.trust_region import TrustRegion
from serd_core.errors import SerdError
from serd_core.learners.mdce_serd import fit_mdce_serd
from serd_core.posterior.parameters import Block
from serd_core.priors.divergence import KldPrior
from serd_core.priors.gaussian import GaussianPrior
from sim.episodes.execution import Execution
from storage.files import atomic_write_bytes

LOOKS = {"gradient": (RED, "-"), "lbfgs": (PURPLE, "--"), "trust-region": (BLUE, "-.")}
#: With it the objective has one finite maximum.
PRIOR = KldPrior(0.1) + GaussianPrior(10.0, Block.REWARD)


@dataclass(frozen=True)
class AscentsConfig:
    """Settings of the comparison of optimisers."""

    side: int = setting(5, "cells along each side of the grid")
    n_demonstrations: int = setting(20, "demonstrations learned from")
    n_steps: int = setting(40, "decisions of a demonstration")
    gradient_tolerance: float = setting(1e-6, "largest gradient entry at which a fit ends")
    max_steps: int = setting(20_000, "steps after which a fit ends without convergence")
    step_size: float = setting(1.0, "alpha of gradient ascent, on the objective per decision")
    seed: int = setting(0, "of which every random number is derived")

    def __post_init__(self) -> None:
        if min(self.n_demonstrations, self.n_steps, self.max_steps) < 1 or not self.step_size > 0:
            raise SerdError(
                "n_demonstrations, n_steps and max_steps must be at least 1 and step_size above 0,"
                f" got {self.n_demonstrations}, {self.n_steps}, {self.max_steps} and"
                f" {self.step_size}"
            )


def ascent_of(
    name: str, gradient_tolerance: float, max_steps: int, step_size: float = 1.0
) -> Ascent:
    """The optimiser of that name; SerdError with all names otherwise."""
    if name == "gradient":
        return GradientAscent(lambda _: step_size, gradient_tolerance, max_steps)
    if name == "lbfgs":
        return Lbfgs(gradient_tolerance=gradient_tolerance, max_steps=max_steps)
    if name == "trust-region":
        return TrustRegion(gradient_tolerance=gradient_tolerance, max_steps=max_steps)
    raise SerdError(f"ascent must be among {', '.join(LOOKS)}, got {name!r}")


def run_ascents(
    config: AscentsConfig, folder: Path, execution: Execution, progress: Progress
) -> pd.DataFrame:
    """Write the cost of each optimiser, its objective by step, and a figure; returns the costs."""
    del execution  # parallel work would disturb the timings
    costs, traces = [], {}
    for number, name in enumerate(LOOKS):
        progress(number, len(LOOKS))
        cost, traces[name] = climb(config, name)
        costs.append(cost)
    progress(len(LOOKS), len(LOOKS))
    table = pd.DataFrame(costs)
    trace = pd.concat(traces, names=["ascent", "step"]).reset_index()
    trace["gap"] = table["objective"].max() - trace.pop("objective")
    write_table(folder / "costs.csv", table)
    write_table(folder / "gaps.csv", trace)
    atomic_write_bytes(folder / "gaps.png", png_bytes(gaps_figure(trace)))
    return table


def climb(config: AscentsConfig, name: str) -> tuple[Row, pd.DataFrame]:
    """What one optimiser costs, and its objective after each step."""
    sizes = GridworldConfig(side=config.side, n_steps=config.n_steps, seed=config.seed)
    scene, _ = scenes(sizes)
    rng = np.random.default_rng([config.seed, 1])
    decisions = demonstrate(sizes, scene, config.n_demonstrations, rng)
    began_s = time.perf_counter()
    fit = fit_mdce_serd(
        scene.world.problem,
        decisions,
        initial_weights=np.zeros(2),
        prior=PRIOR,
        ascent=ascent_of(name, config.gradient_tolerance, config.max_steps, config.step_size),
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
