"""Gridworld navigation on satellite images (section 4.6.2, Figs. 4.10 to 4.13).

Demonstrations are sampled from a known expert, MDCE or policy matching; learners use only them.
Weights start at random as in the thesis; SERD then goes in two stages, weights first (see
`serd_core.learners.mdce_irl`). Each repetition gives one row per number of demonstrations and
learner, with the four measures of the figures: log-likelihood of new demonstrations, divergence of
the dynamics, divergence of the policy, and log-likelihood in the transfer environment.
"""

from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
from scipy.special import rel_entr

from lab.experiments.gridworld.figures import MEASURES, measures_figure
from lab.experiments.gridworld.landscape import (
    Landscape,
    generated_landscape,
    image_brightness,
    landscape_of_image,
)
from lab.experiments.gridworld.learners import EXPERTS, Estimate, LearnerInput
from lab.experiments.gridworld.problem import Gridworld, gridworld, true_dynamics
from lab.experiments.running.divergence import dynamics_divergence
from lab.experiments.running.experiment import Count, Findings, SeededConfig, Session, Sizes
from lab.experiments.running.tables import Row, quartiles, welch_test
from serd_core.arrays import FloatArray
from serd_core.bayes.laplace import posterior_policy
from serd_core.demonstrations.decisions import Decisions, state_action_counts
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.solved_policy import boltzmann_policy, soft_policy
from serd_core.selection.evaluation import policy_log_likelihood
from serd_files.settings import setting


class GridworldConfig(SeededConfig):
    """Settings of section 4.6.2; other lengths and numbers are our choice."""

    expert: Literal["mdce", "pm"] = setting(
        "mdce", "policy of the demonstrator; pm: Policy-Matching"
    )
    image: Path | None = setting(None, "training image; without it a generated landscape")
    transfer_image: Path | None = setting(None, "transfer image; without it a generated landscape")
    side: int = setting(20, "cells along each side of the grid", ge=4)
    discount: float = setting(0.99, "discount per decision", ge=0, lt=1)
    weights: tuple[float, float] = setting((6.0, 6.0), "true weights of brightness and goal")
    temperature: float = setting(2.0, "true temperature of a pm demonstrator (4.62); mdce has none")
    sizes: Sizes = setting((1, 3, 6, 12, 25, 50), "demonstrations learned from")
    n_steps: Count = setting(40, "decisions of a demonstration")
    n_test_episodes: Count = setting(200, "new episodes on which likelihoods are measured")
    n_repetitions: Count = setting(50, "repetitions of every size")


@dataclass(frozen=True, eq=False)
class Scene:
    """An environment with its true policy and new demonstrations for the measures."""

    world: Gridworld
    policy: FloatArray
    test: Decisions


def run_gridworld(config: GridworldConfig, session: Session) -> Findings:
    """The measures with their tests."""
    table = session.repeat(partial(one_repetition, config), config.n_repetitions, config)
    found = with_measures(table)
    files = dict(found.files)
    if config.n_repetitions > 1:
        files |= _tests(config, table)
    return Findings(found.summary, files)


def with_measures(table: pd.DataFrame) -> Findings:
    """The rows, quartiles of each measure and their figure; the log-likelihood is the summary."""
    by = {name: quartiles(table, name, ["size", "learner"]) for name in MEASURES}
    summary = pd.concat(by, names=["measure", None]).reset_index("measure")
    files = {"measures.csv": table, "summary.csv": summary, "measures.png": measures_figure(table)}
    return Findings(by["log_likelihood"], files)


def one_repetition(config: GridworldConfig, number: int) -> list[Row]:
    """Sample demonstrations, fit every learner on growing parts of them, measure."""
    training, transfer = scenes(config)
    rng = np.random.default_rng([config.seed, 1, number])
    n_most, n_steps = max(config.sizes), config.n_steps
    decisions = demonstrate(training.world, training.policy, n_most, n_steps, rng)
    rows = []
    for size in config.sizes:
        seen = decisions.select(decisions.episode < size)
        given = LearnerInput(training.world.problem, seen, n_steps, rng)
        for name, learner in EXPERTS[config.expert].items():
            row: Row = {"repetition": number, "size": size, "learner": name}
            rows.append(row | measures(training, transfer, learner(given)))
    return rows


def scenes(config: GridworldConfig) -> tuple[Scene, Scene]:
    """Training and transfer environments; the same for all repetitions."""
    training = _landscape(config, config.image, 0)
    transfer = _landscape(config, config.transfer_image, 1)
    return (
        _scene(config, gridworld(training, config.discount, goal_at_left=False), 0),
        _scene(config, gridworld(transfer, config.discount, goal_at_left=True), 1),
    )


def policy_divergence(truth: FloatArray, estimate: FloatArray, visits: FloatArray) -> float:
    """Mean KLD from a true to an estimated (S, A) policy under (S,) visits."""
    seen = visits > 0
    by_state = np.sum(rel_entr(truth[seen], estimate[seen]), axis=1)
    return float(visits[seen] @ by_state / visits.sum())


def measures(training: Scene, transfer: Scene, estimate: Estimate) -> Row:
    """The four panels of Figs. 4.12 and 4.13."""
    policy = policy_of(training.world.problem, estimate)
    moved = policy_of(transfer.world.problem, estimate)
    problem = training.world.problem
    visits = state_action_counts(training.test, problem.mdp.n_states, problem.mdp.n_actions)
    return {
        "log_likelihood": policy_log_likelihood(problem, training.test, policy),
        "dynamics_divergence": dynamics_divergence(
            problem, true_dynamics(), estimate.dynamics, visits
        ),
        "policy_divergence": policy_divergence(training.policy, policy, visits.sum(axis=1)),
        "transfer_log_likelihood": policy_log_likelihood(
            transfer.world.problem, transfer.test, moved
        ),
        "converged": estimate.converged,
    }


def policy_of(problem: TabularProblem, estimate: Estimate) -> FloatArray:
    """(S, A) soft policy, or Boltzmann over optimal values where there is a temperature.

    Of an estimate with draws, the mean of their soft policies.
    """
    if estimate.draws is not None:
        return posterior_policy(problem, estimate.draws)
    weights, dynamics = estimate.weights, estimate.dynamics
    if estimate.temperature is None:
        return soft_policy(problem, weights, dynamics).probabilities
    return boltzmann_policy(problem, weights, dynamics, estimate.temperature).probabilities


def _tests(config: GridworldConfig, table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Welch's t-test of each SERD learner against each other learner, where it is defined."""
    serd = [name for name in EXPERTS[config.expert] if "SERD" in name]
    others = [name for name in EXPERTS[config.expert] if "SERD" not in name]
    return {
        f"welch_{measure}.csv": pd.DataFrame(
            [
                row
                for first, second in product(serd, others)
                for row in welch_test(table, measure, first, second)
            ]
        )
        for measure in ("log_likelihood", "transfer_log_likelihood")
    }


def _landscape(config: GridworldConfig, image: Path | None, number: int) -> Landscape:
    if image is None:
        return generated_landscape(config.side, np.random.default_rng([config.seed, 2, number]))
    return landscape_of_image(image_brightness(image), config.side)


def _scene(config: GridworldConfig, world: Gridworld, number: int) -> Scene:
    temperature = config.temperature if config.expert == "pm" else None
    truth = Estimate(np.array(config.weights), true_dynamics(), temperature, converged=True)
    policy = policy_of(world.problem, truth)
    rng = np.random.default_rng([config.seed, 3, number])
    test = demonstrate(world, policy, config.n_test_episodes, config.n_steps, rng)
    return Scene(world, policy, test)


def demonstrate(
    world: Gridworld, policy: FloatArray, n_episodes: int, n_steps: int, rng: np.random.Generator
) -> Decisions:
    """Sample demonstrations of an expert with that policy (S, A)."""
    mdp, truth = world.problem.mdp, true_dynamics()
    return sample_decisions(
        mdp, policy, truth, world.starts, n_episodes=n_episodes, n_steps=n_steps, rng=rng
    )
