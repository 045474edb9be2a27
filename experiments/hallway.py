"""Learning to navigate in a populated hallway: learners over demonstrations (Figs. 5.8 and 5.9).

Random subsets of the training demonstrations are split into training and validation episodes; MDCE
SERD chooses the weight of its divergence prior on the validation episodes. Measured are the
log-likelihoods of new decisions in the training and the transfer task, and the divergence of the
dynamics from those estimated from everything that was ever recorded.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from experiments.hallway_data import HallwayData, RecordingPlan, hallway_data
from experiments.repetitions import Execution, Progress, Row, run_repetitions
from serd_core.arrays import FloatArray
from serd_core.ascent.trust_region import TrustRegion
from serd_core.demonstrations import Decisions, state_action_counts
from serd_core.errors import SerdError
from serd_core.estimation import estimate_dynamics
from serd_core.evaluation import (
    dynamics_divergence,
    policy_log_likelihood,
    validation_log_likelihood,
)
from serd_core.fit_result import FitResult
from serd_core.learners.importance_samples import (
    hoeffding_thresholds,
    sample_from_estimates,
)
from serd_core.learners.mdce_irl import fit_mdce_irl_by_entropy, fit_mdce_irl_by_likelihood
from serd_core.learners.mdce_serd import fit_mdce_serd
from serd_core.learners.relative_entropy_irl import fit_relative_entropy_irl
from serd_core.learners.staged_start import weights_under_initial_dynamics
from serd_core.navigation import NavigationProblem
from serd_core.parameters import Block
from serd_core.policies.solved_policy import soft_policy
from serd_core.priors.divergence import KldPrior
from serd_core.priors.gaussian import GaussianPrior
from serd_core.selection.prior_weight import select_weight, split_episodes
from sim.scenario import load_scenario
from sim.scenario_grid import navigation_problem_of

ASCENT = TrustRegion(gradient_tolerance=1e-5, max_steps=150)
PLAN = RecordingPlan()
#: The three panels of Fig. 5.9, as columns of the table.
MEASURES = ("log_likelihood", "transfer_log_likelihood", "dynamics_divergence")
#: Keeps weights finite where a small subset shows one action only.
WIDE = GaussianPrior(30.0, Block.REWARD)
#: Few demonstrations have features that no policy has under their estimated dynamics.
SLACK = 1e-3
#: See `experiments.gridworld`: the full thresholds allow all weights to be 0.
THRESHOLD_SHARE = 0.1


@dataclass(frozen=True)
class HallwayConfig:
    """sizes: demonstrations of a subset, validation included; prior_weights: candidates."""

    scenario: str = "hallway"
    discount: float = 0.95
    sizes: tuple[int, ...] = (2, 4, 8, 12, 20)
    prior_weights: tuple[float, ...] = (0.01, 0.1, 1.0, 10.0, 100.0)
    validation_share: float = 0.15
    n_repetitions: int = 10
    plan: RecordingPlan = PLAN
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.sizes or min(self.sizes) < 2 or max(self.sizes) > self.plan.n_training:
            raise SerdError(
                f"sizes must be from 2 to n_training ({self.plan.n_training}), got {self.sizes}"
            )


Learned = tuple[FloatArray, FloatArray]
"""Reward weights (F,) and outcome probabilities (M, K)."""


def run_hallway(
    config: HallwayConfig, folder: Path, execution: Execution, progress: Progress
) -> list[Row]:
    """One row per repetition, size and learner; recordings and repetitions are kept in `folder`."""
    scenario = load_scenario(config.scenario)
    problem = navigation_problem_of(scenario, config.discount)
    data = hallway_data(scenario, problem, config.plan, folder / "recordings", progress)
    repetition = partial(one_repetition, config, problem, data)
    return run_repetitions(
        repetition,
        config.n_repetitions,
        folder / "repetitions",
        repr(config),
        execution,
        progress,
    )


def one_repetition(
    config: HallwayConfig, problem: NavigationProblem, data: HallwayData, number: int
) -> list[Row]:
    """Random subsets of growing size, all learners on each."""
    rng = np.random.default_rng([config.seed, number])
    shuffled = rng.permutation(data.training.episodes)
    rows = []
    for size in config.sizes:
        subset = data.training.select_episodes(shuffled[:size])
        for name, learner in LEARNERS.items():
            learned = learner(config, problem, subset, rng)
            row: Row = {"repetition": number, "size": size, "learner": name}
            rows.append(row | measures(problem, data, learned))
    return rows


def measures(problem: NavigationProblem, data: HallwayData, learned: Learned) -> Row:
    """The three panels of Fig. 5.9."""
    weights, dynamics = learned
    policy = soft_policy(problem, weights, dynamics).probabilities
    mdp = problem.mdp
    visits = state_action_counts(data.training, mdp.n_states, mdp.n_actions)
    return {
        "log_likelihood": policy_log_likelihood(problem, data.test, policy),
        "transfer_log_likelihood": policy_log_likelihood(problem, data.transfer, policy),
        "dynamics_divergence": dynamics_divergence(problem, data.dynamics, dynamics, visits),
    }


def _mdce_serd(
    config: HallwayConfig, problem: NavigationProblem, subset: Decisions, rng: np.random.Generator
) -> Learned:
    training, validation = split_episodes(subset, config.validation_share, rng)
    start = weights_under_initial_dynamics(problem, training)

    def fit(weight: float) -> FitResult:
        return fit_mdce_serd(
            problem,
            training,
            initial_weights=start,
            prior=KldPrior(weight) + WIDE,
            ascent=ASCENT,
        )

    selection = select_weight(
        fit,
        lambda found: validation_log_likelihood(problem, validation, found),
        config.prior_weights,
    )
    return selection.fit.reward_weights, selection.fit.outcome_probabilities


def _by_likelihood(
    config: HallwayConfig, problem: NavigationProblem, subset: Decisions, rng: np.random.Generator
) -> Learned:
    del config
    fit = fit_mdce_irl_by_likelihood(problem, subset, rng=rng, prior=WIDE, ascent=ASCENT)
    return fit.reward_weights, fit.outcome_probabilities


def _by_entropy(
    config: HallwayConfig, problem: NavigationProblem, subset: Decisions, rng: np.random.Generator
) -> Learned:
    del config
    fit = fit_mdce_irl_by_entropy(problem, subset, rng=rng, slack=SLACK, ascent=ASCENT)
    return fit.reward_weights, fit.outcome_probabilities


def _relative_entropy(
    config: HallwayConfig, problem: NavigationProblem, subset: Decisions, rng: np.random.Generator
) -> Learned:
    del config
    longest = int(np.unique(subset.episode, return_counts=True)[1].max())
    samples, policy = sample_from_estimates(
        problem, subset, n_episodes=500, n_steps=2 * longest, rng=rng
    )
    fit = fit_relative_entropy_irl(
        problem,
        subset,
        samples=samples,
        sampling_policy=policy,
        thresholds=THRESHOLD_SHARE
        * hoeffding_thresholds(problem, len(subset.episodes), horizon=longest),
        rng=rng,
    )
    return fit.reward_weights, estimate_dynamics(problem, subset)


Learner = Callable[[HallwayConfig, NavigationProblem, Decisions, np.random.Generator], Learned]
LEARNERS: dict[str, Learner] = {
    "MDCE SERD": _mdce_serd,
    "MDCE IRL, likelihood": _by_likelihood,
    "MDCE IRL, entropy": _by_entropy,
    "REIRL": _relative_entropy,
}
