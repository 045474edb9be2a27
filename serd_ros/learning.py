"""From decisions to a model file: what the learner node does with a bag, without any ROS."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from serd_core.ascent.ascent import Step
from serd_core.demonstrations import Decisions
from serd_core.estimation import estimate_dynamics
from serd_core.fit_result import FitResult
from serd_core.learners.mdce_serd import fit_mdce_serd
from serd_core.navigation import NavigationProblem
from serd_core.priors.divergence import KldPrior
from serd_ros.configs import LearnerConfig
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
    decisions: Decisions,
    config: LearnerConfig,
    on_step: Told,
    goal_entry_s: Sequence[float] = (),
) -> Lesson:
    """Fit MDCE SERD with tied belief from several random starts and keep the likeliest.

    on_step: called with the start's number (from 0) and the step just taken. goal_entry_s: kept
    with the model, see `storage.model_file`.
    """
    problem = navigation_problem_of(scenario, config.discount)
    initial = estimate_dynamics(problem, decisions, pseudo_count=config.pseudo_count)
    fits = [
        fit_mdce_serd(
            problem,
            decisions,
            rng=rng,
            initial_dynamics=initial,
            prior=KldPrior(weight=config.prior_weight),
            on_step=lambda step, start=start: on_step(start, step),  # type: ignore[misc]
        )
        for start, rng in enumerate(np.random.default_rng(config.seed).spawn(config.starts))
    ]
    best = max(fits, key=lambda fit: fit.objective)
    return Lesson(
        fit=best,
        model=_model(scenario, problem, decisions, config, best, goal_entry_s),
        objectives=tuple(fit.objective for fit in fits),
    )


def _model(
    scenario: Scenario,
    problem: NavigationProblem,
    decisions: Decisions,
    config: LearnerConfig,
    fit: FitResult,
    goal_entry_s: Sequence[float],
) -> ModelFile:
    return model_of_fit(
        fit,
        problem,
        scenario=scenario.name,
        method="MDCE SERD, belief and truth tied",
        prior=f"KLD to the M-estimate, weight {config.prior_weight:g}",
        decision_period_s=scenario.decision_period_s,
        n_episodes=len(decisions.episodes),
        goal_entry_s=goal_entry_s,
    )
