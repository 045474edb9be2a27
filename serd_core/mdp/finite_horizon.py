"""Problems that end after a number of periods, as problems whose states know the period.

State t S + s is state s of period t. Decisions are made in the periods 0, ..., T - 1; the states of
period T are final. So an optimal or soft policy may differ from period to period, and every learner
applies as it is. Solving takes backward induction in effect: nothing leads to an earlier period.
"""

from dataclasses import replace

import numpy as np

from serd_core import checks
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.decisions import Decisions, require_decisions
from serd_core.dynamics.outcome_models import OutcomeModels, SparseModel, fixed_transitions
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem, TabularProblem, require_problem


def finite_horizon(
    problem: Problem,
    n_periods: int,
    *,
    features: FloatArray | None = None,
    terminal_features: FloatArray | None = None,
) -> TabularProblem:
    """Unroll a problem over T = n_periods decisions, into (T + 1) S states.

    features: (T, S, A, F) where they depend on the period. terminal_features: (S, F), counted once,
    on arrival in period T; by default 0, and in states that are final anyway what they go on
    paying. Outcome models are shared by all periods. SerdError where moves take time.

        unrolled = sc.finite_horizon(problem, 20)
        fit = sc.fit_mdce_serd(unrolled, sc.decisions_in_periods(decisions, n_states, 20))
    """
    require_problem(problem)
    checks.require_count("n_periods", n_periods, 1, "10")
    mdp, n_states, given = problem.mdp, problem.mdp.n_states, problem.features
    what = f"the features of {n_periods + 1} periods of {n_states} states"
    checks.require_memory(what, (n_periods + 1.0) * given.nbytes, "take fewer periods")
    periods = np.broadcast_to(given, (n_periods, *given.shape))
    if features is not None:
        periods = checks.float_array("features", features, periods.shape)
    last = mdp.available.argmax(axis=1)
    once = np.where(mdp.final[:, None], given[np.arange(n_states), last], 0.0)
    if terminal_features is not None:
        once = checks.float_array("terminal_features", terminal_features, once.shape)
        once = (1.0 - mdp.discount) * once
    paid = np.broadcast_to(once[:, None], (1, *given.shape))
    return TabularProblem(
        Mdp(_in_periods(mdp.transitions, n_periods, last), mdp.discount),
        np.concatenate([periods, paid]).reshape(-1, *given.shape[1:]),
        problem.feature_names,
    )


def _in_periods(model: TransitionModel, n_periods: int, last: IntArray) -> TransitionModel:
    """The same transitions, each into the next period; in the last one the (S,) actions stay."""
    n_states, n_actions = model.available.shape
    start = n_states * np.arange(n_periods)[:, None]
    final = n_states * n_periods + np.arange(n_states)
    if isinstance(model, SparseModel):
        return fixed_transitions(
            (n_states * (n_periods + 1), n_actions),
            np.append(model.state + start, final),
            np.append(np.tile(model.action, n_periods), last),
            np.append(model.next_state + start + n_states, final),
            np.append(np.tile(model.known, n_periods), np.ones(n_states)),
        )
    if not (isinstance(model, OutcomeModels) and model.moves is model):
        raise SerdError(
            "transitions must be OutcomeModels or known to get a finite horizon, got"
            f" {type(model).__name__}; leave out how long moves take"
        )
    moved = model.successors + (start + n_states)[:, :, None, None]
    stays = np.broadcast_to(final[:, None, None], (1, *model.successors.shape))
    model_of = np.tile(model.model_of, (n_periods + 1, 1))
    model_of[final] = 0
    available = np.tile(model.available, (n_periods + 1, 1))
    available[final] = np.arange(n_actions) == last[:, None]
    successors = np.concatenate([moved, stays]).reshape(-1, *model.successors.shape[1:])
    return replace(model, successors=successors, model_of=model_of, available=available)


def decisions_in_periods(
    decisions: Decisions, n_states: int, n_periods: int, period: IntArray | None = None
) -> Decisions:
    """Move decisions into the states of `finite_horizon`.

    n_states: S of the problem itself; period: (N,) of each decision; by default the first of an
    episode is in period 0, the next in 1, in the order of their times. SerdError where an episode
    is longer than the horizon.

        unrolled = sc.decisions_in_periods(decisions, n_states, 20)
    """
    require_decisions(decisions)
    checks.require_count("n_periods", n_periods, 1, "10")
    if period is None:
        order = np.lexsort((decisions.time_s, decisions.episode))
        sorted_episodes = decisions.episode[order]
        period = np.empty(len(decisions), dtype=np.int64)
        period[order] = np.arange(len(order)) - np.searchsorted(sorted_episodes, sorted_episodes)
    period = checks.int_array("period", period, (len(decisions),))
    inside = (period >= 0) & (period < n_periods)
    fix = "take more periods or shorter episodes"
    checks.require_each("period", period, inside, f"be one of {n_periods} from 0", fix)
    for name in ("state", "next_state"):
        checks.require_index(
            name, getattr(decisions, name), n_states, "a state of the problem itself"
        )
    return replace(
        decisions,
        state=decisions.state + period * n_states,
        next_state=decisions.next_state + (period + 1) * n_states,
    )
