"""How long moves take, of any fit: learned with the rewards, or counted beside them.

SERD by evidence learns laws of dwell times together with rewards and outcomes
(docs/semi_markov.md). The other methods learn by decisions that all take the same time, as the
thesis does, and where actions are hidden all methods do; then the laws are counted.

Whether dwell times also differ by place is decided by episodes that were left out.
"""

from dataclasses import replace

import numpy as np

from serd_app.learning.settings import MethodName
from serd_bag.quantities import counted
from serd_core.arrays import FloatArray
from serd_core.bayes.draws import PosteriorDraws
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.grid import Grid, Outcome
from serd_core.grid.navigation import WAITING, NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.semi_markov.models import SemiMarkovModels, require_timed
from serd_core.semi_markov.place import LEAST_EPISODES, PLACES, compare_places, fit_places
from serd_core.semi_markov.timed_decisions import TimedDecisions
from serd_files.model_file import LearnedDynamics

#: Methods that learn laws of dwell times together with rewards and outcomes.
TOGETHER: tuple[MethodName, ...] = ("mdce_serd_evidence", "mdce_serd_belief_evidence")


def learns_durations(method: MethodName, decisions: Decisions) -> bool:
    """Whether a method learns the laws together with the rewards from such decisions."""
    return method in TOGETHER and not decisions.hidden.any()


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
