"""From decisions to a model file: the one recipe of `serd learn`, the learner node and the demo."""

from dataclasses import dataclass

import numpy as np

from serd_app.demonstrations.demonstrations import Demonstrations
from serd_app.demonstrations.grid.flow_field import load_flow
from serd_app.errors import AppError
from serd_app.learning.durations import dynamics_of, learns_durations, with_still_waits
from serd_app.learning.fit_data import FitData, ProgressCallback, fit_data, ignore_progress
from serd_app.learning.knowledge import knowledge_of, posterior_of
from serd_app.learning.methods import MethodResult, fit_by
from serd_app.learning.outcome import FitOutcome, learned_traps
from serd_app.learning.settings import LearningSettings, MethodName
from serd_app.places.kept_scenario import own_scenario_yaml
from serd_core.arrays import FloatArray
from serd_core.bayes.draws import PosteriorDraws, laplace_draws
from serd_core.bayes.laplace import Laplace
from serd_core.grid.navigation import NavigationProblem, with_dwell_times
from serd_core.semi_markov.models import semi_markov_problem
from serd_core.semi_markov.timed_decisions import TimedDecisions
from serd_files.model_file import model_of_fit
from serd_sim.scenario.grid import grid_of, navigation_problem_of
from serd_sim.scenario.scenario import Scenario


@dataclass(frozen=True)
class LearningTask:
    """Where demonstrations were made; scenario: its name, empty where the grid was fitted.

    problem: its decisions take time. own_flow: whether the flow of people is another than the
    scenario's. scenario_yaml: the file that is kept beside the model, empty for none.
    """

    problem: NavigationProblem
    scenario: str
    own_flow: bool = False
    scenario_yaml: str = ""


def task_in(scenario: Scenario, discount: float, flow_table: str = "") -> LearningTask:
    """Learning in a scenario; flow_table: file of a recorded flow, empty for the scenario's own."""
    flow = load_flow(flow_table, grid_of(scenario)) if flow_table else None
    problem = navigation_problem_of(scenario, discount, flow=flow)
    return LearningTask(
        problem=with_dwell_times(problem, patience_s=scenario.patience_s, wait_s=scenario.wait_s),
        scenario=scenario.name,
        own_flow=flow is not None,
        scenario_yaml=own_scenario_yaml(scenario),
    )


def learn(
    task: LearningTask,
    demonstrations: Demonstrations,
    settings: LearningSettings,
    on_progress: ProgressCallback = ignore_progress,
    warm_weights: FloatArray | None = None,
) -> FitOutcome:
    """Fit with the method of the settings; SerdError where decisions are too few or impossible.

    warm_weights: (F,) where SERD starts, in place of its start in two stages.
    """
    require_enough(demonstrations, settings)
    decisions, rng = demonstrations.decisions, np.random.default_rng(settings.seed)
    problem = _problem_of(task.problem, settings.method, decisions)
    data = fit_data(problem, decisions, settings, rng, warm_weights, on_progress)
    found = fit_by(settings.method, data)
    posterior, draws = _posterior_of(data, found)
    fit = with_still_waits(found.fit) if decisions.hidden.any() else found.fit
    dynamics, durations = dynamics_of(task.problem, decisions, fit, draws)
    paced = semi_markov_problem(task.problem, log_pace=dynamics.log_pace)
    driven = dynamics.truth[None, :] if dynamics.draws is None else dynamics.draws
    return FitOutcome(
        fit,
        model_of_fit(
            fit,
            task.problem,
            scenario=task.scenario,
            method=settings.method,
            prior=found.prior,
            n_episodes=len(decisions.episodes),
            dynamics=dynamics,
            own_flow=task.own_flow,
        ),
        learned_traps(paced, decisions, found.fit.reward_weights, driven),
        problem,
        found.prior_weight,
        found.validation,
        None if posterior is None else knowledge_of(problem, posterior),
        task.scenario_yaml,
        belief="" if found.beliefs is None else found.beliefs.sentence(),
        durations=durations,
    )


def _problem_of(
    timed: NavigationProblem, method: MethodName, decisions: TimedDecisions
) -> NavigationProblem:
    """What a method learns on: decisions that take time, or all the same."""
    problem = timed if learns_durations(method, decisions) else timed.by_decisions
    return problem.with_still_waits if decisions.hidden.any() else problem


def _posterior_of(
    data: FitData, found: MethodResult
) -> tuple[Laplace | None, PosteriorDraws | None]:
    """The posterior of a fit and draws from it, None for methods without."""
    if found.beliefs is not None:
        return found.beliefs.approximations[0], found.beliefs.draws(data.rng)
    posterior = posterior_of(data.problem, data.decisions, found.fit)
    return posterior, None if posterior is None else laplace_draws(posterior, data.rng)


def require_enough(demonstrations: Demonstrations, settings: LearningSettings) -> None:
    """AppError where there are too few decisions to learn from."""
    n_decisions = len(demonstrations.decisions)
    if n_decisions < settings.minimum_decisions:
        raise AppError(
            f"at least minimum_decisions = {settings.minimum_decisions} decisions are needed to "
            f"learn, got {n_decisions}; demonstrate more"
        )
