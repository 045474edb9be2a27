"""From decisions to a model file: what the learner node does, without any ROS."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from serd_app.demonstrations.demonstrations import Demonstrations
from serd_app.demonstrations.flow_table import load_flow
from serd_app.errors import AppError
from serd_app.learning.settings import LessonSettings
from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import Step
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.navigation import NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.learners.mdce_serd import fit_mdce_serd
from serd_core.learners.staged_start import WIDE
from serd_core.learners.start import initial_weights_or_sample
from serd_core.priors.divergence import KldPrior
from serd_core.priors.prior import Prior
from sim.scenario.grid import grid_of, navigation_problem_of
from sim.scenario.scenario import Scenario
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


@dataclass(frozen=True)
class LearningTask:
    """Where demonstrations were made; scenario: its name, empty where the grid was fitted.

    own_flow: whether the flow of people is another than the scenario's.
    """

    problem: NavigationProblem
    scenario: str
    decision_period_s: float
    own_flow: bool = False


def task_in(scenario: Scenario, discount: float, flow_table: str = "") -> LearningTask:
    """Learning in a scenario; flow_table: file of a recorded flow, empty for the scenario's own."""
    flow = load_flow(flow_table, grid_of(scenario)) if flow_table else None
    return LearningTask(
        problem=navigation_problem_of(scenario, discount, flow=flow),
        scenario=scenario.name,
        decision_period_s=scenario.decision_period_s,
        own_flow=flow is not None,
    )


def learn(
    task: LearningTask,
    demonstrations: Demonstrations,
    settings: LessonSettings,
    on_step: Told,
    warm_weights: FloatArray | None = None,
) -> Lesson:
    """Fit MDCE SERD with tied belief and keep the likeliest of all starts.

    on_step: called with the start's number (from 0) and the step just taken. warm_weights: (F,)
    the one start there is, in place of `settings.starts` random ones. SerdError where there are
    too few decisions or they cannot be of this place.
    """
    check_enough(demonstrations, settings)
    decisions, problem = demonstrations.decisions, task.problem
    initial = estimate_dynamics(problem, decisions, pseudo_count=settings.pseudo_count)
    fits = [
        fit_mdce_serd(
            problem,
            decisions,
            initial_weights=weights,
            dynamics=initial,
            prior=prior_of(settings),
            on_step=lambda step, start=start: on_step(start, step),  # type: ignore[misc]
        )
        for start, weights in enumerate(_starts(problem, settings, warm_weights))
    ]
    best = max(fits, key=lambda fit: fit.objective)
    return Lesson(
        fit=best,
        model=_model(task, demonstrations, settings, best),
        objectives=tuple(fit.objective for fit in fits),
    )


def check_enough(demonstrations: Demonstrations, settings: LessonSettings) -> None:
    """AppError where there are too few decisions to learn from."""
    n_decisions = len(demonstrations.decisions)
    if n_decisions < settings.minimum_decisions:
        raise AppError(
            f"at least minimum_decisions = {settings.minimum_decisions} decisions are needed to "
            f"learn, got {n_decisions}; demonstrate more"
        )


def _starts(
    problem: NavigationProblem, settings: LessonSettings, warm_weights: FloatArray | None
) -> list[FloatArray]:
    if warm_weights is not None:
        return [warm_weights]
    generators = np.random.default_rng(settings.seed).spawn(settings.starts)
    return [initial_weights_or_sample(problem, None, rng) for rng in generators]


def prior_of(settings: LessonSettings) -> Prior:
    """The divergence to the M-estimate (4.91), and a bound to weights that nothing else bounds.

    Without the second a single episode, in which every decision agrees, has no likeliest weights:
    they grow without end, and later fits that begin there do not come back.
    """
    return KldPrior(weight=settings.prior_weight) + WIDE


def _model(
    task: LearningTask, demonstrations: Demonstrations, settings: LessonSettings, fit: FitResult
) -> ModelFile:
    return model_of_fit(
        fit,
        task.problem,
        scenario=task.scenario,
        method="MDCE SERD, belief and truth tied",
        prior=f"KLD to the M-estimate, weight {settings.prior_weight:g}; normal on reward weights, "
        f"standard deviation {WIDE.standard_deviation:g}",
        decision_period_s=task.decision_period_s,
        n_episodes=len(demonstrations.decisions.episodes),
        goal_entry_s=demonstrations.goal_entry_s,
        own_flow=task.own_flow,
    )
