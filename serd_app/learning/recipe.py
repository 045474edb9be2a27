"""From decisions to a model file: the one recipe of `serd learn`, the learner node and the demo.

SERD by evidence learns laws of dwell times together with rewards and outcomes
(docs/semi_markov.md). The other methods learn by decisions that all take the same time, as the
thesis does, and where actions are hidden all methods do; then the laws are counted. Whether dwell
times also differ by place is decided by episodes that were left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from serd_app.demonstrations.decision_table import load_flow
from serd_app.errors import AppError
from serd_app.learning.criticism import Criticised, criticise
from serd_app.learning.knowledge import (
    DynamicsRow,
    Knowledge,
    dynamics_rows,
    knowledge_of,
    posterior_of,
)
from serd_app.learning.methods import (
    MethodResult,
    ProgressCallback,
    fit_by,
    fit_data,
    ignore_progress,
)
from serd_app.learning.outcome import FitOutcome, LearnedTraps, learned_traps
from serd_app.learning.settings import LearningSettings, MethodName
from serd_app.learning.several_goals import GoalDrives, in_one_problem
from serd_app.places.kept_scenario import own_scenario_yaml
from serd_bag.quantities import counted
from serd_core.arrays import FloatArray
from serd_core.bayes.laplace import Laplace, PosteriorDraws, laplace_draws
from serd_core.demonstrations.decisions import Decisions, TimedDecisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.grid import Grid, Outcome
from serd_core.grid.navigation import WAITING, NavigationProblem, with_dwell_times
from serd_core.learners.fit_result import FitResult
from serd_core.policies.solved_policy import optimal_policy
from serd_core.posterior.beliefs import TiedBelief
from serd_core.selection.evaluation import fitted_policy
from serd_core.selection.joint_dynamics import judge_joint_dynamics
from serd_core.semi_markov.models import SemiMarkovModels, require_timed, semi_markov_problem
from serd_core.semi_markov.place import LEAST_EPISODES, PLACES, compare_places, fit_places
from serd_files.model_file import Check, FeatureRecord, LearnedDynamics, model_of_fit
from serd_sim.drivers.strategy import Plan
from serd_sim.scenario.grid import grid_of, navigation_problem_of
from serd_sim.scenario.scenario import Scenario


@dataclass(frozen=True)
class LearningTask:
    """Where demonstrations were made; scenario: its name, empty where the grid was fitted.

    problem: its decisions take time. own_flow: whether the flow of people is another than the
    scenario's. scenario_yaml: the file that is kept beside the model, empty for none.
    left_out: how many recorded decisions are not given to the recipe, and why; empty for none.
    other_goals: how many decisions other goals would leave, and their places.
    other_drives: to other goals, from which rewards and dynamics are learned as well.
    timeout_s: of the drives that are predicted. unused_features: why features take no part, by
    name; own_features: (S,) of each that the place does not have itself.
    """

    problem: NavigationProblem
    scenario: str
    own_flow: bool = False
    scenario_yaml: str = ""
    left_out: str = ""
    other_goals: tuple[tuple[int, tuple[float, float]], ...] = ()
    other_drives: tuple[GoalDrives, ...] = ()
    timeout_s: float = 120.0
    unused_features: Mapping[str, str] = field(default_factory=dict)
    own_features: Mapping[str, FloatArray] = field(default_factory=dict)


def task_in(scenario: Scenario, discount: float, flow_table: str = "") -> LearningTask:
    """Learning in a scenario; flow_table: file of a recorded flow, empty for the scenario's own."""
    flow = load_flow(flow_table, grid_of(scenario)) if flow_table else None
    problem = navigation_problem_of(scenario, discount, flow=flow)
    return LearningTask(
        problem=with_dwell_times(problem, patience_s=scenario.patience_s, wait_s=scenario.wait_s),
        scenario=scenario.name,
        own_flow=flow is not None,
        scenario_yaml=own_scenario_yaml(scenario),
        timeout_s=scenario.episode_timeout_s,
    )


def learn(
    task: LearningTask,
    decisions: TimedDecisions,
    settings: LearningSettings,
    on_progress: ProgressCallback = ignore_progress,
    warm_weights: FloatArray | None = None,
) -> FitOutcome:
    """Fit with the method of the settings; SerdError where decisions are too few or impossible.

    warm_weights: (F,) where SERD starts, in place of its start in two stages.
    """
    goals = GoalDrives(task.problem, decisions), *task.other_drives
    shared, every = in_one_problem(goals)
    require_enough(every, settings, task)
    rng = np.random.default_rng(settings.seed)
    problem = _problem_of(shared, settings.method, every)
    data = fit_data(problem, every, settings, rng, warm_weights, on_progress)
    learned = _judged(problem, every, fit_by(settings.method, data), rng)
    found, draws = learned.found, learned.draws
    fit = with_still_waits(found.fit) if every.hidden.any() else found.fit
    dynamics, durations = dynamics_of(shared, every, fit, draws)
    n_states = task.problem.mdp.n_states
    dynamics = replace(dynamics, log_pace=dynamics.log_pace[:n_states])
    paced = semi_markov_problem(task.problem, log_pace=dynamics.log_pace)
    driven = dynamics.truth[None, :] if dynamics.draws is None else dynamics.draws
    traps = learned_traps(paced, decisions, found.fit.reward_weights, driven)
    named = {"scenario": task.scenario, "method": settings.method, "prior": found.prior}
    n_episodes = len(every.episodes)
    model = model_of_fit(
        fit, task.problem, n_episodes=n_episodes, dynamics=dynamics, own_flow=task.own_flow, **named
    )
    plan = plan_of(paced, fit, driven, task.timeout_s)
    known = {
        "checks": _checks(task, decisions, settings, learned, plan, traps),
        "features": features_of(task, found.fit.feature_names),
    }
    return FitOutcome(
        fit,
        model.model_copy(update=known),
        traps,
        problem,
        every,
        found.prior_weight,
        found.validation,
        _known(problem, learned, n_states),
        task.scenario_yaml,
        durations=durations,
        both=learned.both,
    )


@dataclass(frozen=True, eq=False)
class _Learned:
    """A fit, its posterior and draws, None where it has none.

    of_moves: the posterior of the moves alone where dynamics are counted, else None.
    joint: which dynamics were taken; both: the two that were compared, none where they were not.
    """

    found: MethodResult
    posterior: Laplace | None = None
    draws: PosteriorDraws | None = None
    of_moves: Laplace | None = None
    joint: Check | None = None
    both: tuple[DynamicsRow, ...] = ()


def _judged(
    problem: NavigationProblem,
    decisions: TimedDecisions,
    found: MethodResult,
    rng: np.random.Generator,
) -> _Learned:
    """Take the joint dynamics of a fit, or counted ones where choices contradict the moves."""
    posterior = posterior_of(problem, decisions, found.fit)
    if posterior is None:
        return _Learned(found)
    draws = laplace_draws(posterior, rng)
    is_tied = isinstance(posterior.coordinates.belief, TiedBelief)
    if not is_tied or decisions.hidden.any():
        return _Learned(found, posterior, draws)
    judged = judge_joint_dynamics(posterior, decisions, rng, draws)
    mark: Literal["holds", "fails"] = "fails" if judged.chosen == "neither" else "holds"
    check = Check(key="joint_dynamics", mark=mark, sentence=judged.sentence)
    both = dynamics_rows(problem, judged.moves, draws)
    if judged.chosen == "joint":
        return _Learned(found, posterior, draws, None, check, both)
    prior = f"{found.prior}; dynamics counted from the moves alone"
    posterior, moves = judged.posterior_of_counted, judged.moves
    draws = laplace_draws(posterior, rng)
    rows = slice(len(draws))  # rewards and dynamics are independent of each other here
    draws = replace(
        draws, truth=moves.truth[rows], outcome_probabilities=moves.outcome_probabilities[rows]
    )
    counted = MethodResult(judged.counted, prior)
    return _Learned(counted, posterior, draws, judged.posterior_of_moves, check, both)


def _known(problem: NavigationProblem, learned: _Learned, n_states: int) -> Knowledge | None:
    """What the fit knows; the gains are those of demonstrations to the first goal."""
    if learned.posterior is None:
        return None
    found = knowledge_of(problem, learned.posterior, learned.of_moves)
    return None if found is None else replace(found, gains=found.gains[:n_states])


def _checks(
    task: LearningTask,
    decisions: TimedDecisions,
    settings: LearningSettings,
    learned: _Learned,
    plan: Plan,
    traps: LearnedTraps,
) -> tuple[Check, ...]:
    """Whether the data support the plan, by the drives to its goal."""
    problem = _problem_of(task.problem, settings.method, decisions)
    tested = Criticised(
        plan,
        decisions,
        with_moves_as_actions(task.problem.grid, decisions),
        problem,
        learned.draws,
        fitted_policy(problem, learned.found.fit),
        traps,
        learned.joint,
    )
    return criticise(tested, np.random.default_rng(settings.seed))


def features_of(task: LearningTask, names: tuple[str, ...]) -> tuple[FeatureRecord, ...]:
    """The features of a fit with their own values, and why others take no part."""
    taken = (FeatureRecord(name=n, values=tuple(task.own_features.get(n, ()))) for n in names)
    unused = (FeatureRecord(name=n, left_out=why) for n, why in task.unused_features.items())
    return (*taken, *unused)


def plan_of(
    problem: NavigationProblem, fit: FitResult, dynamics: FloatArray, timeout_s: float
) -> Plan:
    """What a robot drives by a fit; problem: its decisions take time; dynamics: (n, N) draws."""
    tables = require_timed(problem.mdp.transitions).local_probabilities(dynamics)
    learned = optimal_policy(problem, fit.reward_weights, tables.mean(axis=0))
    return Plan(problem=problem, learned=learned, draws=dynamics, timeout_s=timeout_s)


def _problem_of(
    timed: NavigationProblem, method: MethodName, decisions: TimedDecisions
) -> NavigationProblem:
    """What a method learns on: decisions that take time, or all the same."""
    if decisions.hidden.any():
        return timed.by_decisions.with_still_waits
    return timed if method == "mdce_serd_evidence" else timed.by_decisions


def require_enough(
    decisions: Decisions, settings: LearningSettings, task: LearningTask | None = None
) -> None:
    """AppError where there are too few decisions to learn from, with another goal if one helps."""
    n_decisions, needed = len(decisions), settings.minimum_decisions
    if n_decisions >= needed:
        return
    besides, fix = "", "demonstrate more"
    if task is not None and task.left_out:
        besides = f" besides {task.left_out}"
        fix = "demonstrate more, as no other --goal leaves as many"
        count, (x_m, y_m) = max(task.other_goals, default=(0, (0.0, 0.0)))
        if count >= needed:
            fix = f"demonstrate more, or name --goal {x_m:g},{y_m:g}, which leaves {count}"
    raise AppError(
        f"at least minimum_decisions = {needed} decisions are needed to learn, got"
        f" {n_decisions}{besides}; {fix}"
    )


def with_still_waits(fit: FitResult) -> FitResult:
    """The fit whose waits stay for sure, as `NavigationProblem.with_still_waits` assumed."""
    names = ("outcome_probabilities", "believed_outcome_probabilities")
    tables = {name: getattr(fit, name).copy() for name in (*names, f"initial_{names[0]}")}
    for table in tables.values():
        table[WAITING] = np.eye(table.shape[1])[Outcome.STAY]
    return replace(fit, **tables)


def dynamics_of(
    problem: NavigationProblem,
    decisions: TimedDecisions,
    fit: FitResult,
    draws: PosteriorDraws | None,
) -> tuple[LearnedDynamics, tuple[str, ...]]:
    """The dynamics of a fit with dwell times, and what was found about these, in sentences.

    problem: its decisions take time. fit: of it, or of `by_decisions`, where laws are counted.
    What is known of laws that were learned is in `Knowledge`.
    """
    model = require_timed(problem.mdp.transitions)
    seen = with_moves_as_actions(problem.grid, decisions)
    truth, belief, drawn = fit.parameters.truth, fit.parameters.belief, None
    if draws is not None:
        drawn = draws.truth
    are_counted = len(truth) != model.n_parameters
    if are_counted:
        truth, belief = (
            model.outcomes.fixed_parameters_of(table)[: model.means.start]
            for table in (fit.outcome_probabilities, fit.believed_outcome_probabilities)
        )
        laws = estimate_dynamics(problem, seen)[model.means.start :]
        truth, belief = np.append(truth, laws), np.append(belief, laws)
        if drawn is not None:
            drawn = np.hstack([drawn, np.broadcast_to(laws, (len(drawn), len(laws)))])
            waits = slice(WAITING * model.n_outcomes, model.means.start)
            if decisions.hidden.any():
                drawn[:, waits] = truth[waits]
    log_pace, remark = _places(problem, seen, truth)
    found = LearnedDynamics(truth, belief, log_pace)
    if draws is not None:
        found = replace(found, draws=drawn, reward_draws=draws.reward)
    return found, (_sentence(problem, model, truth), remark) if are_counted else (remark,)


def with_moves_as_actions(grid: Grid, decisions: TimedDecisions) -> TimedDecisions:
    """Decisions with known actions: a hidden one that moved was for the cell that it led to.

    Hidden ones that stayed are left out: nobody knows what they were for.
    """
    hidden = decisions.hidden
    if not hidden.any():
        return decisions
    towards = grid.neighbours[decisions.state] == decisions.next_state[:, None]
    towards &= (decisions.next_state != decisions.state)[:, None]  # no walls, no waits
    action = np.where(hidden, np.argmax(towards, axis=1), decisions.action)
    known = ~hidden | towards.any(axis=1)
    return replace(decisions, action=action).select(known)


def _places(
    problem: NavigationProblem, decisions: TimedDecisions, truth: FloatArray
) -> tuple[FloatArray, str]:
    """(S,) log paces, 0 where places are not supported, and what was decided."""
    none = np.zeros(problem.mdp.n_states)
    if len(decisions.episodes) < LEAST_EPISODES:
        n_episodes = counted(len(decisions.episodes), "episode")
        return none, f"whether moves take longer in some places is not known from {n_episodes}"
    found = compare_places(problem, decisions)
    if found.chosen != PLACES:
        return none, "left-out episodes do not support dwell times that differ by place"
    pace = fit_places(problem, decisions, truth)
    return pace.log_pace, (
        "left-out episodes support dwell times that differ by place, by a factor of"
        f" {np.exp(pace.deviation):.2f} (one standard deviation)"
    )


def _sentence(problem: NavigationProblem, model: SemiMarkovModels, truth: FloatArray) -> str:
    means = np.exp(truth[model.means])[model.law_of[:, 0]]
    each = (
        f"{problem.model_names[m].replace('_', ' ')} {means[m]:.2f} s"
        for m in problem.used_models
        if model.law_of[m, 0] >= 0
    )
    return f"a move takes on average, counted: {', '.join(each)}"
