"""Early stopping on validation demonstrations against fits to the maximum (section 5.2).

Without a prior, the maximum of the likelihood over-fits a handful of demonstrations. Three fits of
MDCE SERD are compared on the gridworld: to all demonstrations up to the maximum, to the training
part up to the maximum, and to the training part until the likelihood of the validation part no
longer improves.
"""

from functools import partial
from typing import Annotated

import numpy as np
from pydantic import Field

from lab.estimators.early_stopping import fit_serd_with_early_stopping
from lab.experiments.gridworld.ascents import AscentName, make_ascent
from lab.experiments.gridworld.experiment import (
    GridworldConfig,
    demonstrate,
    measures,
    scenes,
    with_measures,
)
from lab.experiments.gridworld.learners import FIXED, Estimate
from lab.experiments.running.experiment import Count, Findings, SeededConfig, Session
from lab.experiments.running.tables import Row
from serd_core.demonstrations.decisions import Decisions
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import fit_serd
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.solved_policy import MdcePolicy
from serd_core.selection.evaluation import split_episodes
from serd_files.settings import setting, setting_of

POLICY = MdcePolicy()
WHOLE, PART, STOPPED = "MDCE SERD", "MDCE SERD, training part", "MDCE SERD, stopped early"


class EarlyStoppingConfig(SeededConfig):
    """Settings of early stopping."""

    ascent: AscentName = setting("trust-region", "optimiser; gradient is that of Algorithm 1")
    max_steps: Count = setting(150, "steps after which a fit ends; gradient needs thousands")
    patience: Count = setting(5, "steps without a better validation likelihood before the end")
    validation_share: float = setting(
        0.25, "share of the demonstrations for validation", gt=0, lt=1
    )
    side: int = setting_of(GridworldConfig, "side", default=10)
    sizes: tuple[Annotated[int, Field(ge=2)], ...] = setting(
        (2, 4, 8, 16, 32), "demonstrations, validation included", min_length=1
    )
    n_steps: int = setting_of(GridworldConfig, "n_steps")
    n_repetitions: int = setting_of(GridworldConfig, "n_repetitions", default=20)

    @property
    def world(self) -> GridworldConfig:
        """Settings of the scenes and demonstrations."""
        return GridworldConfig(side=self.side, n_steps=self.n_steps, seed=self.seed)


def run_early_stopping(config: EarlyStoppingConfig, session: Session) -> Findings:
    """The measures of the three fits."""
    return with_measures(
        session.repeat(partial(one_repetition, config), config.n_repetitions, config)
    )


def one_repetition(config: EarlyStoppingConfig, number: int) -> list[Row]:
    """Sample demonstrations, fit growing parts of them in all three ways, measure."""
    training, transfer = scenes(config.world)
    rng = np.random.default_rng([config.seed, 1, number])
    n_most, n_steps = max(config.sizes), config.n_steps
    decisions = demonstrate(training.world, training.policy, n_most, n_steps, rng)
    rows = []
    for size in config.sizes:
        seen = decisions.select(decisions.episode < size)
        fits = fits_of(config, training.world.problem, seen, rng)
        for name, fit in fits.items():
            row: Row = {"repetition": number, "size": size, "learner": name, "steps": fit.n_steps}
            rows.append(row | measures(training, transfer, Estimate.of(fit)))
    return rows


def fits_of(
    config: EarlyStoppingConfig, problem: TabularProblem, seen: Decisions, rng: np.random.Generator
) -> dict[str, FitResult]:
    """The three fits by name; each starts at the weights under its M-estimate of the dynamics."""
    part, validation = split_episodes(seen, config.validation_share, rng)
    start = rng.uniform(-10.0, 10.0, 2)
    ascent = make_ascent(config.ascent, 1e-5, config.max_steps)

    def weights(decisions: Decisions) -> FitResult:
        return fit_serd(
            problem, decisions, POLICY, belief=FIXED, ascent=ascent, initial_weights=start
        )

    of_seen, of_part = weights(seen).reward_weights, weights(part).reward_weights
    return {
        WHOLE: fit_serd(problem, seen, POLICY, ascent=ascent, initial_weights=of_seen),
        PART: fit_serd(problem, part, POLICY, ascent=ascent, initial_weights=of_part),
        STOPPED: fit_serd_with_early_stopping(
            problem,
            part,
            validation,
            POLICY,
            ascent=ascent,
            initial_weights=of_part,
            patience=config.patience,
        ),
    }
