"""From decisions to a model file: what the learner node does, without any ROS."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bags.demonstrations import Demonstrations
from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import Step
from serd_core.estimation import estimate_dynamics
from serd_core.fit_result import FitResult
from serd_core.learners.mdce_serd import fit_mdce_serd
from serd_core.learners.serd import initial_weights_or_sample
from serd_core.navigation import NavigationProblem
from serd_core.priors.divergence import KldPrior
from serd_ros.configs import LearnerConfig
from serd_ros.errors import NodeError
from sim.scenario import Scenario
from sim.scenario_grid import navigation_problem_of
from storage.model_file import ModelFile, model_of_fit

Told = Callable[[int, Step], None]


@dataclass(frozen=True, eq=False)
class Lesson:
    """The best fit over all starts, and the file that keeps it."""

    fit: FitResult
    model: ModelFile
    objectives: tuple[float, ...]

    def trace_table(self) -> str:
        """The best start's objective after each step, as CSV."""
        rows = enumerate(self.fit.objective_trace.tolist(), start=1)
        return "step,objective\n" + "".join(f"{step},{value!r}\n" for step, value in rows)


def learn(
    scenario: Scenario,
    demonstrations: Demonstrations,
    config: LearnerConfig,
    on_step: Told,
    warm_weights: FloatArray | None = None,
) -> Lesson:
    """Fit MDCE SERD with tied belief and keep the likeliest of all starts.

    on_step: called with the start's number (from 0) and the step just taken. warm_weights: (F,)
    the one start there is, in place of `config.starts` random ones. SerdError where there are
    too few decisions or they cannot be of this scenario.
    """
    decisions = demonstrations.decisions
    if len(decisions) < config.minimum_decisions:
        raise NodeError(
            f"at least minimum_decisions = {config.minimum_decisions} decisions are needed to "
            f"learn, got {len(decisions)}; demonstrate more"
        )
    problem = navigation_problem_of(scenario, config.discount)
    initial = estimate_dynamics(problem, decisions, pseudo_count=config.pseudo_count)
    fits = [
        fit_mdce_serd(
            problem,
            decisions,
            initial_weights=weights,
            initial_dynamics=initial,
            prior=KldPrior(weight=config.prior_weight),
            on_step=lambda step, start=start: on_step(start, step),  # type: ignore[misc]
        )
        for start, weights in enumerate(_starts(problem, config, warm_weights))
    ]
    best = max(fits, key=lambda fit: fit.objective)
    return Lesson(
        fit=best,
        model=_model(scenario, problem, demonstrations, config, best),
        objectives=tuple(fit.objective for fit in fits),
    )


def _starts(
    problem: NavigationProblem, config: LearnerConfig, warm_weights: FloatArray | None
) -> list[FloatArray]:
    if warm_weights is not None:
        return [warm_weights]
    generators = np.random.default_rng(config.seed).spawn(config.starts)
    return [initial_weights_or_sample(problem, None, rng) for rng in generators]


def _model(
    scenario: Scenario,
    problem: NavigationProblem,
    demonstrations: Demonstrations,
    config: LearnerConfig,
    fit: FitResult,
) -> ModelFile:
    return model_of_fit(
        fit,
        problem,
        scenario=scenario.name,
        method="MDCE SERD, belief and truth tied",
        prior=f"KLD to the M-estimate, weight {config.prior_weight:g}",
        decision_period_s=scenario.decision_period_s,
        n_episodes=len(demonstrations.decisions.episodes),
        goal_entry_s=demonstrations.goal_entry_s,
    )
