"""Learning problems from tables of transitions: arrays, sparse matrices, and Gymnasium.

A terminal state gets one action, which stays. Its features count once, on arrival: staying for ever
pays (1 - gamma) f each time, which is f in all. Transitions given from it are not used, nor are
their features.
A pair (s, a) without transitions is not available.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import index
from typing import Any

import numpy as np
import scipy.sparse

from serd_core.arrays import (
    FloatArray,
    IntArray,
    chosen_indices,
    float_array,
    int_array,
    number_array,
    require_index,
    shown,
)
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.sparse_model import fixed_transitions, learned_transitions
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem, unique_names

#: Probability, next state, reward, terminated.
Outcome = tuple[float, int, float, bool]


@dataclass(frozen=True, eq=False)
class TransitionTable:
    """(E,) columns of P(s' | s, a) over (S, A) pairs."""

    n_pairs: tuple[int, int]
    state: IntArray
    action: IntArray
    next_state: IntArray
    probability: FloatArray

    def expected(self, values: FloatArray, ends: IntArray) -> FloatArray:
        """(S, A, F) expectation over s' of (E, F) values of each entry, 0 in terminal states."""
        sums = np.zeros((*self.n_pairs, values.shape[1]))
        np.add.at(sums, (self.state, self.action), values * self.probability[:, None])
        sums[ends] = 0.0
        return sums


def from_transitions(
    transitions: Any,
    features: Any,
    *,
    discount: float,
    feature_names: Sequence[str] | None = None,
    terminal: Iterable[int] = (),
    learned: bool = False,
) -> TabularProblem:
    """Make a learning problem from a table of transitions, known or to be learned.

    transitions: (S, A, S) array; or a sequence of A sparse (S, S) matrices. Pairs (s, a) without
    entries are not available.
    features: (S, F) of states or (S, A, F) of pairs; feature_names: (F,), None numbers them.
    discount: gamma in [0, 1) per decision.
    terminal: states in which an episode ends, or an (S,) mask of them; their features count once.
    learned: whether the probabilities are unknown. The table then lists which transitions can
    happen, by any positive numbers, and each pair has a distribution of its own over them.

        problem = sc.from_transitions(transitions, features, discount=0.95, terminal=[24])
    """
    table = _table_of(transitions)
    ends = _terminal_states(terminal, table.n_pairs[0])
    return _listed(table, features, discount, feature_names, ends, learned=learned)


def from_gymnasium(
    environment: Any,
    *,
    discount: float,
    features: Any = None,
    feature_names: Sequence[str] | None = None,
    model_of: Any = None,
) -> TabularProblem:
    """Make a learning problem from an environment with a table `P`, as Gymnasium's toy texts have.

    `P[s][a]` lists (probability, next state, reward, terminated); states that end an episode become
    terminal. The reward of the environment is not used by learners; without `features` it is the
    one feature, so a weight of 1 is the environment's own reward.
    features: (S, F) or (S, A, F); discount: gamma in [0, 1) per decision.
    model_of: None for dynamics that are known; else outcome models are learned, and the k-th entry
    of each list is their outcome k: one number, or (S, A) of the model of each pair.

        problem = sc.from_gymnasium(gymnasium.make("FrozenLake-v1"), discount=0.99)
    """
    rows = _gymnasium_rows(environment)
    n_states, n_actions = len(rows), max(len(actions) for actions in rows)
    ends = _terminal_states(
        {s for row in rows for a in row for _, s, _, done in a if done}, n_states
    )
    flat = [
        (state, action, *outcome)
        for state, actions in enumerate(rows)
        for action, outcomes in enumerate(actions)
        for outcome in outcomes
    ]
    state, action, probability, following, reward, _ = map(np.array, zip(*flat, strict=True))
    if model_of is None:
        require_index("next_state", following, n_states, "a state")
        table = TransitionTable((n_states, n_actions), state, action, following, probability)
        if features is None:
            values = float_array("rewards", reward, (len(state),))[:, None]
            features, names = table.expected(values, ends), feature_names or ("reward",)
            return _listed(table, features, discount, names, ends)
        return _listed(table, features, discount, feature_names, ends)
    if features is None:
        raise SerdError(
            "features must be given where outcome models are learned, as an expected reward depends"
            " on them, got None; pass (S, F) or (S, A, F) features"
        )
    successors = _outcome_lists(rows, n_actions)
    available = np.any(successors >= 0, axis=2)
    available[ends], successors[ends] = False, ends[:, None, None]
    available[ends, 0] = True
    which = int_array("model_of", model_of)
    if not which.ndim:
        which = np.broadcast_to(which, available.shape)
    which = int_array("model_of", which, available.shape)
    models = OutcomeModels(successors, which, available, n_models=int(which.max()) + 1)
    return _problem(Mdp(models, discount), features, feature_names, ends)


def _problem(
    mdp: Mdp, features: Any, names: Sequence[str] | None, ends: IntArray
) -> TabularProblem:
    """The problem with (S, F) or (S, A, F) features, which count once in terminal states."""
    pairs = mdp.available.shape
    values = np.asarray(number_array("features", features), dtype=np.float64)
    if values.ndim == 2 and len(values) == pairs[0]:
        values = np.broadcast_to(values[:, None, :], (*pairs, values.shape[1]))
    if values.ndim != 3 or values.shape[:2] != pairs:
        raise SerdError(
            f"features must have shape ({pairs[0]}, F) or ({pairs[0]}, {pairs[1]}, F), got"
            f" {values.shape}; reshape them"
        )
    if len(ends):
        values = values.copy()
        values[ends] *= 1.0 - mdp.discount
    numbered = tuple(f"feature {i}" for i in range(values.shape[2]))
    return TabularProblem(mdp, values, numbered if names is None else unique_names(names))


def _listed(
    table: TransitionTable,
    features: Any,
    discount: float,
    names: Sequence[str] | None,
    ends: IntArray,
    *,
    learned: bool = False,
) -> TabularProblem:
    """The problem of a table of transitions, of which those from terminal states are not used."""
    kept = (table.probability != 0) & ~np.isin(table.state, ends)
    listed = (
        np.concatenate([table.state[kept], ends]),
        np.concatenate([table.action[kept], np.zeros_like(ends)]),
        np.concatenate([table.next_state[kept], ends]),
    )
    if learned:
        model = learned_transitions(table.n_pairs, *listed)
    else:
        probability = np.concatenate([table.probability[kept], np.ones(len(ends))])
        model = fixed_transitions(table.n_pairs, *listed, probability)
    return _problem(Mdp(model, discount), features, names, ends)


def _table_of(transitions: Any) -> TransitionTable:
    """The entries of arrays or sparse matrices."""
    if isinstance(transitions, np.ndarray):
        transitions = np.atleast_1d(transitions)
    if not (isinstance(transitions, np.ndarray | Sequence) or scipy.sparse.issparse(transitions)):
        raise SerdError(
            "transitions must be an (S, A, S) array or a sequence of sparse matrices, got"
            f" {shown(transitions)}; pass one of these"
        )
    given = [transitions] if scipy.sparse.issparse(transitions) else list(transitions)
    if given and all(map(scipy.sparse.issparse, given)):
        return _of_matrices(list(map(scipy.sparse.coo_array, given)))
    dense = float_array("transitions", transitions, (None, None, None))
    if dense.shape[0] != dense.shape[2]:
        raise SerdError(
            f"transitions must have shape (states, actions, states), got {dense.shape}; transpose"
            " them"
        )
    state, action, following = np.nonzero(dense)
    entries = dense[state, action, following]
    return TransitionTable(dense.shape[:2], state, action, following, entries)


def _of_matrices(matrices: list[scipy.sparse.coo_array]) -> TransitionTable:
    n_states = matrices[0].shape[0]
    for action, matrix in enumerate(matrices):
        if matrix.shape != (n_states, n_states):
            raise SerdError(
                f"transitions[{action}] must have shape ({n_states}, {n_states}), got"
                f" {matrix.shape}; pass one square matrix per action"
            )
    return TransitionTable(
        (n_states, len(matrices)),
        np.concatenate([matrix.row for matrix in matrices]).astype(np.int64),
        np.repeat(np.arange(len(matrices)), [len(matrix.row) for matrix in matrices]),
        np.concatenate([matrix.col for matrix in matrices]).astype(np.int64),
        np.concatenate([matrix.data for matrix in matrices]).astype(np.float64),
    )


def _terminal_states(terminal: Iterable[int], n_states: int) -> IntArray:
    try:
        listed = list(terminal)
    except TypeError as error:
        raise SerdError(
            f"terminal must list states, got {shown(terminal)}; use for example [0]"
        ) from error
    return np.unique(chosen_indices("terminal", listed, n_states, "a state"))


def _gymnasium_rows(environment: Any) -> list[list[list[Outcome]]]:
    table = getattr(getattr(environment, "unwrapped", environment), "P", None)
    if table is None:
        raise SerdError(
            "environment must have a table P of its transitions, as FrozenLake, Taxi and"
            f" CliffWalking have, got {type(environment).__name__}; use from_transitions"
        )
    rows = [
        [_outcomes(f"P[{s}][{a}]", each) for a, each in enumerate(_numbered(f"P[{s}]", actions))]
        for s, actions in enumerate(_numbered("P", table))
    ]
    if not any(outcomes for row in rows for outcomes in row):
        raise SerdError(
            f"P must list at least one outcome, got {shown(table)}; pass a made environment"
        )
    return rows


def _numbered(name: str, table: Any) -> list[Any]:
    """The values of a mapping with the keys 0, 1 and so on."""
    if not isinstance(table, Mapping):
        raise SerdError(
            f"{name} must be a dictionary, got {shown(table)}; use dict(enumerate(...))"
        )
    if set(table) != set(range(len(table))):
        raise SerdError(
            f"the keys of {name} must be 0 to {len(table) - 1}, got {shown(list(table))}; use"
            " from_transitions, in which a pair may be left out"
        )
    return [table[number] for number in range(len(table))]


def _outcomes(name: str, listed: Any) -> list[Outcome]:
    """The outcomes of one pair as numbers."""
    try:
        # 0.0 + refuses text, which float() reads.
        return [
            (float(0.0 + probability), index(state), float(0.0 + reward), bool(done))
            for probability, state, reward, done in listed
        ]
    except (TypeError, ValueError) as error:
        raise SerdError(
            f"{name} must list outcomes (probability, next state, reward, terminated), got"
            f" {shown(listed)}; use from_transitions for tables of another form"
        ) from error


def _outcome_lists(rows: list[list[list[Outcome]]], n_actions: int) -> IntArray:
    """(S, A, K) next states, -1 where there is no action; a certain outcome is all K outcomes."""
    n_outcomes = max(len(outcomes) for row in rows for outcomes in row)
    successors = np.full((len(rows), n_actions, n_outcomes), -1, dtype=np.int64)
    for state, row in enumerate(rows):
        for action, outcomes in enumerate(row):
            reached = [following for _, following, _, _ in outcomes]
            if len(reached) not in (1, n_outcomes):
                raise SerdError(
                    f"P[{state}][{action}] must list 1 or {n_outcomes} outcomes where models are"
                    f" learned, got {len(reached)}; build OutcomeModels, or leave model_of out"
                )
            successors[state, action] = reached
    return successors
