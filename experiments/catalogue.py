"""All experiments by name, each a function that leaves its tables and figures in a folder.

A command line needs nothing else: look the name up, build the configuration, run. Repetitions that
are already in the folder are not run again.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments import minimum_example, policy_cost, priors, rust
from experiments.figures.gridworld import environment_figure, measures_figure
from experiments.figures.minimum_example import estimates_figure, likelihood_figure
from experiments.figures.policy_cost import cost_figure
from experiments.figures.priors import surfaces_figure
from experiments.gridworld import experiment as gridworld
from experiments.gridworld.learners import EXPERTS
from experiments.gridworld.problem import true_dynamics
from experiments.running.repetitions import Progress, Row, write_table
from experiments.running.summary import quartiles, welch_test
from report.style import png_bytes
from serd_core.errors import SerdError
from serd_core.policies.solved_policy import optimal_policy, soft_policy
from sim.episodes.execution import Execution
from storage.files import atomic_write_bytes

Run = Callable[[Any, Path, Execution, Progress], list[Row]]


@dataclass(frozen=True)
class Experiment:
    """name; what it shows; type of its frozen configuration; run: returns its summary table."""

    name: str
    shows: str
    config: type[Any]
    run: Run


def experiment_of(name: str) -> Experiment:
    """The experiment of that name; SerdError with all names otherwise."""
    for experiment in EXPERIMENTS:
        if experiment.name == name:
            return experiment
    names = ", ".join(experiment.name for experiment in EXPERIMENTS)
    raise SerdError(f"experiment must be among {names}, got {name!r}")


def _minimum_example(
    config: minimum_example.MinimumExampleConfig,
    folder: Path,
    execution: Execution,
    progress: Progress,
) -> list[Row]:
    rows = minimum_example.run_minimum_example(config, folder / "repetitions", execution, progress)
    summary = quartiles(rows, "log_likelihood", ["learner", "mode", "size"])
    summary.sort(key=lambda row: (row["learner"], row["mode"], row["size"]))
    write_table(folder / "estimates.csv", rows)
    write_table(folder / "log_likelihood.csv", summary)
    atomic_write_bytes(folder / "estimates.png", png_bytes(estimates_figure(rows)))
    atomic_write_bytes(folder / "log_likelihood.png", png_bytes(likelihood_figure(rows)))
    return summary


def _priors(
    config: priors.PriorsConfig, folder: Path, execution: Execution, progress: Progress
) -> list[Row]:
    del execution
    progress(0, 1)
    surfaces, optima = priors.prior_surfaces(config), priors.optimal_distributions(config)
    write_table(folder / "optimal_distributions.csv", optima)
    atomic_write_bytes(folder / "surfaces.png", png_bytes(surfaces_figure(surfaces, optima)))
    progress(1, 1)
    return optima


def _policy_cost(
    config: policy_cost.PolicyCostConfig, folder: Path, execution: Execution, progress: Progress
) -> list[Row]:
    del execution  # timings want the machine for themselves
    progress(0, 1)
    rows = policy_cost.measure_policy_cost(config, time.perf_counter)
    exponents = policy_cost.fitted_exponents(rows)
    write_table(folder / "seconds.csv", rows)
    write_table(folder / "exponents.csv", exponents)
    atomic_write_bytes(folder / "cost.png", png_bytes(cost_figure(rows, exponents)))
    progress(1, 1)
    return exponents


def _gridworld(
    config: gridworld.GridworldConfig, folder: Path, execution: Execution, progress: Progress
) -> list[Row]:
    rows = gridworld.run_gridworld(config, folder / "repetitions", execution, progress)
    write_table(folder / "measures.csv", rows)
    for measure in gridworld.MEASURES:
        write_table(folder / f"{measure}.csv", quartiles(rows, measure, ["size", "learner"]))
    if config.n_repetitions > 1:
        _write_tests(config, rows, folder)
    atomic_write_bytes(folder / "measures.png", png_bytes(measures_figure(rows)))
    weights = np.array(config.weights)
    solve = soft_policy if config.expert == "mdce" else optimal_policy
    for name, scene in zip(("training", "transfer"), gridworld.scenes(config), strict=True):
        solved = solve(scene.world.problem, weights, true_dynamics())
        figure = environment_figure(scene, weights, solved.value)
        atomic_write_bytes(folder / f"{name}.png", png_bytes(figure))
    return quartiles(rows, "log_likelihood", ["size", "learner"])


def _write_tests(config: gridworld.GridworldConfig, rows: list[Row], folder: Path) -> None:
    """Welch's t-test of each SERD learner against each other learner, where it is defined."""
    learners = list(EXPERTS[config.expert])
    serd = [name for name in learners if "SERD" in name]
    others = [name for name in learners if "SERD" not in name]
    for measure in ("log_likelihood", "transfer_log_likelihood"):
        table = [
            row
            for first in serd
            for second in others
            for row in welch_test(rows, measure, first, second)
        ]
        write_table(folder / f"welch_{measure}.csv", table)


def _rust(
    config: rust.RustConfig, folder: Path, execution: Execution, progress: Progress
) -> list[Row]:
    del execution
    progress(0, 1)
    result = rust.estimate_rust(config)
    table: list[Row] = [
        {"name": "RC", "estimate": result.replacement_cost, "error": result.replacement_cost_error},
        {
            "name": "theta_11",
            "estimate": result.maintenance_cost,
            "error": result.maintenance_cost_error,
        },
    ]
    increments = zip(result.increments, result.increment_errors, strict=True)
    table += [
        {"name": f"increment {number}", "estimate": float(share), "error": float(error)}
        for number, (share, error) in enumerate(increments)
    ]
    table.append({"name": "log-likelihood", "estimate": result.log_likelihood, "error": None})
    write_table(folder / "estimates.csv", table)
    progress(1, 1)
    return table


EXPERIMENTS = (
    Experiment(
        "minimum-example",
        "two explanations of one behaviour (section 4.6.1)",
        minimum_example.MinimumExampleConfig,
        _minimum_example,
    ),
    Experiment("priors", "what each prior prefers (section 4.5.4)", priors.PriorsConfig, _priors),
    Experiment(
        "policy-cost",
        "what a gradient costs (Table 4.2)",
        policy_cost.PolicyCostConfig,
        _policy_cost,
    ),
    Experiment(
        "gridworld",
        "navigation on satellite images (section 4.6.2)",
        gridworld.GridworldConfig,
        _gridworld,
    ),
    Experiment("rust", "bus engine replacement (Rust 1987)", rust.RustConfig, _rust),
)
