"""Problems that end after a number of periods, as problems whose states know the period.

State t S + s is state s of period t. Decisions are made in the periods 0, ..., T - 1; the states of
period T are final. So an optimal or soft policy may differ from period to period, and every learner
applies as it is. Solving takes backward induction in effect: nothing leads to an earlier period.
"""

from dataclasses import replace

import numpy as np

from serd_core.arrays import (
    FloatArray,
    IntArray,
    first_index,
    float_array,
    int_array,
    require_count,
    require_memory,
)
from serd_core.demonstrations.decisions import Decisions, require_decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.sparse_model import SparseModel, fixed_transitions
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
    paying. Outcome models stay those of the problem, which all periods share; transitions entry by
    entry must be known. SerdError for others, and for features of another shape.

        unrolled = sc.finite_horizon(problem, 20)
        fit = sc.fit_mdce_serd(unrolled, sc.decisions_in_periods(decisions, n_states, 20))
    """
    require_problem(problem)
    require_count("n_periods", n_periods, 1, "10")
    mdp, given = problem.mdp, problem.features
    n_states, n_features = mdp.n_states, given.shape[2]
    require_memory(
        f"the features of {n_periods + 1} periods of {n_states} states",
        (n_periods + 1.0) * given.size * given.itemsize,
        "take fewer periods",
    )
    periods = np.broadcast_to(given, (n_periods, *given.shape))
    if features is not None:
        periods = float_array("features", features, periods.shape)
    last = mdp.available.argmax(axis=1)
    goes_on = given[np.arange(n_states), last][:, None]
    paid = np.where(mdp.final[:, None, None], goes_on, np.zeros_like(given))
    if terminal_features is not None:
        once = float_array("terminal_features", terminal_features, (n_states, n_features))
        paid = np.broadcast_to((1.0 - mdp.discount) * once[:, None], given.shape)
    return TabularProblem(
        Mdp(_in_periods(mdp.transitions, n_periods, last), mdp.discount),
        np.concatenate([periods.reshape(-1, *given.shape[1:]), paid]),
        problem.feature_names,
    )


def _in_periods(model: TransitionModel, n_periods: int, last: IntArray) -> TransitionModel:
    """The same transitions, each into the next period; in the last one the (S,) actions stay."""
    n_states, n_actions = model.available.shape
    final = n_states * n_periods + np.arange(n_states)
    if isinstance(model, SparseModel) and not model.n_parameters:
        period = n_states * np.repeat(np.arange(n_periods), len(model.state))
        known = model.local_probabilities(np.zeros(0))
        return fixed_transitions(
            (n_states * (n_periods + 1), n_actions),
            np.concatenate([np.tile(model.state, n_periods) + period, final]),
            np.concatenate([np.tile(model.action, n_periods), last]),
            np.concatenate([np.tile(model.next_state, n_periods) + period + n_states, final]),
            np.concatenate([np.tile(known, n_periods), np.ones(n_states)]),
        )
    if not (isinstance(model, OutcomeModels) and model.moves is model):
        raise SerdError(
            "transitions must be OutcomeModels or known to get a finite horizon, got"
            f" {type(model).__name__}; use counted_transitions or by_decisions"
        )
    shift = n_states * np.arange(1, n_periods + 1)[:, None, None, None]
    moved = (model.successors + shift).reshape(-1, *model.successors.shape[1:])
    stays = np.broadcast_to(final[:, None, None], model.successors.shape)
    return replace(
        model,
        successors=np.concatenate([moved, stays]),
        model_of=np.concatenate([*[model.model_of] * n_periods, np.zeros_like(model.model_of)]),
        available=np.concatenate(
            [*[model.available] * n_periods, np.arange(n_actions) == last[:, None]]
        ),
    )


def decisions_in_periods(
    decisions: Decisions, n_states: int, n_periods: int, period: IntArray | None = None
) -> Decisions:
    """Move decisions into the states of `finite_horizon`.

    n_states: S of the problem itself; period: (N,) of each decision; by default the first of an
    episode is in period 0, the next in 1, in the order of their times.
    """
    require_decisions(decisions)
    require_count("n_periods", n_periods, 1, "10")
    if period is None:
        order = np.lexsort((decisions.time_s, decisions.episode))
        _, first, length = np.unique(
            decisions.episode[order], return_index=True, return_counts=True
        )
        period = np.empty(len(decisions), dtype=np.int64)
        period[order] = np.arange(len(decisions)) - np.repeat(first, length)
    else:
        period = int_array("period", period, (len(decisions),))
    if (wrong := first_index((period < 0) | (period >= n_periods))) is not None:
        raise SerdError(
            f"decision {wrong[0]} (episode {decisions.episode[wrong]}) must be in one of the"
            f" {n_periods} periods from 0 to {n_periods - 1}, got period {period[wrong]}; take"
            " more periods or shorter episodes"
        )
    for name in ("state", "next_state"):
        if (outside := first_index(getattr(decisions, name) >= n_states)) is not None:
            raise SerdError(
                f"{name} of decision {outside[0]} must be one of the {n_states} states of a period,"
                f" got {getattr(decisions, name)[outside]}; pass decisions of the problem itself"
            )
    return replace(
        decisions,
        state=decisions.state + period * n_states,
        next_state=decisions.next_state + (period + 1) * n_states,
    )
