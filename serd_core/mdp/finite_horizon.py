"""Problems that end after a number of periods, as problems whose states know the period.

State t S + s is state s of period t. Decisions are made in the periods 0, ..., T - 1; the states of
period T are final. So an optimal or soft policy may differ from period to period, and every learner
applies as it is. Solving takes backward induction in effect: nothing leads to an earlier period.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from serd_core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    first_index,
    float_array,
    int_array,
    require_count,
)
from serd_core.demonstrations.decisions import Decisions, require_decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.sparse_model import SparseModel, fixed_transitions
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem, TabularProblem, require_problem
from serd_core.memory import require_memory


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
    paying. Outcome models and parameters stay those of the problem, which all periods share;
    pseudo-counts of a DirichletPrior are of all periods together, other priors of transitions count
    each period.

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
    last = _last_action(mdp.available)
    goes_on = given[np.arange(n_states), last][:, None]
    paid = np.where(mdp.final[:, None, None], goes_on, np.zeros_like(given))
    if terminal_features is not None:
        once = float_array("terminal_features", terminal_features, (n_states, n_features))
        paid = np.broadcast_to((1.0 - mdp.discount) * once[:, None], given.shape)
    return TabularProblem(
        Mdp(_in_periods(mdp.transitions, n_periods), mdp.discount),
        np.concatenate([periods.reshape(-1, *given.shape[1:]), paid]),
        problem.feature_names,
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
        period = _places(decisions)
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


def _places(decisions: Decisions) -> IntArray:
    """(N,) place of each decision in its episode, by time."""
    order = np.lexsort((decisions.time_s, decisions.episode))
    _, first, length = np.unique(decisions.episode[order], return_index=True, return_counts=True)
    place = np.empty(len(decisions), dtype=np.int64)
    place[order] = np.arange(len(decisions)) - np.repeat(first, length)
    return place


def _last_action(available: BoolArray) -> IntArray:
    """(S,) the one action in period T: the first that the state has."""
    return np.asarray(available.argmax(axis=1))


def _in_periods(model: TransitionModel, n_periods: int) -> TransitionModel:
    """The same transitions, each into the next period; those of the last one stay."""
    if isinstance(model, OutcomeModels) and model.moves is model:
        return _outcomes_in_periods(model, n_periods)
    if isinstance(model, SparseModel):
        return _entries_in_periods(model, n_periods)
    raise SerdError(
        "transitions must be OutcomeModels or a SparseModel to get a finite horizon, got"
        f" {type(model).__name__}"
    )


def _outcomes_in_periods(model: OutcomeModels, n_periods: int) -> OutcomeModels:
    n_states, n_actions, _ = model.successors.shape
    shift = n_states * np.arange(1, n_periods + 1)[:, None, None, None]
    moved = (model.successors.astype(np.int64) + shift).reshape(-1, *model.successors.shape[1:])
    last = n_states * n_periods + np.arange(n_states)
    stays = np.broadcast_to(last[:, None, None], model.successors.shape)
    only_first = np.arange(n_actions) == _last_action(model.available)[:, None]
    return replace(
        model,
        successors=np.concatenate([moved, stays]),
        model_of=np.concatenate([*[model.model_of] * n_periods, np.zeros_like(model.model_of)]),
        available=np.concatenate([*[model.available] * n_periods, only_first]),
    )


def _entries_in_periods(model: SparseModel, n_periods: int) -> SparseModel:
    n_states, n_actions = model.n_pairs
    period = np.repeat(np.arange(n_periods), len(model.state))
    last = n_states * n_periods + np.arange(n_states)
    columns = (
        np.concatenate([np.tile(model.state, n_periods) + n_states * period, last]),
        np.concatenate([np.tile(model.action, n_periods), _last_action(model.available)]),
        np.concatenate([np.tile(model.next_state, n_periods) + n_states * (period + 1), last]),
    )
    n_pairs = (n_states * (n_periods + 1), n_actions)
    entries = partial(_repeated, model.probabilities, n_periods, n_states)
    if not model.parameter_count:
        return fixed_transitions(n_pairs, *columns, entries(np.zeros(0)))
    gradient = partial(_summed, model.vector_jacobian, n_periods, n_states)
    n_copies = n_periods * model.n_copies
    return SparseModel(n_pairs, *columns, model.parameter_count, entries, gradient, n_copies)


def _repeated(
    probabilities: Callable[[FloatArray], FloatArray],
    n_periods: int,
    n_final: int,
    parameters: FloatArray,
) -> FloatArray:
    """Entries of one period for each, and 1 for staying in each of the final states."""
    found = np.asarray(probabilities(parameters), dtype=np.float64)
    return np.concatenate([np.tile(found, n_periods), np.ones(n_final)])


def _summed(
    vector_jacobian: Callable[[FloatArray, FloatArray], FloatArray],
    n_periods: int,
    n_final: int,
    parameters: FloatArray,
    gradient: FloatArray,
) -> FloatArray:
    """Vector-Jacobian product of `_repeated`."""
    repeated = gradient[: len(gradient) - n_final].reshape(n_periods, -1)
    return vector_jacobian(parameters, repeated.sum(axis=0))
