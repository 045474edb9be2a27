"""Learning problems from tables of transitions: arrays, and environments of Gymnasium.

A terminal state gets one action, which stays. Its features count once, on arrival: staying for ever
pays (1 - gamma) f each time, which is f in all. Transitions given from it are not used, nor are
their features. A pair (s, a) without transitions is not available.
"""

from collections.abc import Iterable, Mapping, Sequence
from operator import index
from typing import Any

import numpy as np

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

    transitions: (S, A, S) array. Pairs (s, a) without entries are not available.
    features: (S, F) of states or (S, A, F) of pairs; feature_names: (F,), None numbers them.
    discount: gamma in [0, 1) per decision.
    terminal: states in which an episode ends, or an (S,) mask of them; their features count once.
    learned: whether the probabilities are unknown. The table then lists which transitions can
    happen, by any positive numbers, and each pair has a distribution of its own over them.

        problem = sc.from_transitions(transitions, features, discount=0.95, terminal=[24])
    """
    dense = float_array("transitions", transitions, (None, None, None))
    if dense.shape[0] != dense.shape[2]:
        raise SerdError(
            f"transitions must have shape (states, actions, states), got {dense.shape}; transpose"
            " them"
        )
    try:
        listed = list(terminal)
    except TypeError as error:
        raise SerdError(
            f"terminal must list states, got {shown(terminal)}; use for example [0]"
        ) from error
    ends = np.unique(chosen_indices("terminal", listed, len(dense), "a state"))
    state, action, following = np.nonzero(dense)
    chances, pairs = dense[state, action, following], (dense.shape[0], dense.shape[1])
    mdp = _mdp(pairs, (state, action, following), chances, ends, discount, learned=learned)
    return _problem(mdp, features, feature_names, ends)


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
    pairs = len(rows), max(len(actions) for actions in rows)
    flat = [
        (state, action, *outcome)
        for state, actions in enumerate(rows)
        for action, outcomes in enumerate(actions)
        for outcome in outcomes
    ]
    state, action, probability, following, reward, done = map(np.array, zip(*flat, strict=True))
    require_index("next_state", following, len(rows), "a state")
    ends = np.unique(following[done])
    if model_of is not None:
        if features is None:
            raise SerdError(
                "features must be given where outcome models are learned, as an expected reward"
                " depends on them, got None; pass (S, F) or (S, A, F) features"
            )
        mdp = Mdp(_outcome_models(rows, pairs, ends, model_of), discount)
        return _problem(mdp, features, feature_names, ends)
    if features is None:
        features, feature_names = np.zeros((*pairs, 1)), feature_names or ("reward",)
        paid = float_array("rewards", reward) * probability
        np.add.at(features[..., 0], (state, action), paid)
        features[ends] = 0.0
    mdp = _mdp(pairs, (state, action, following), probability, ends, discount)
    return _problem(mdp, features, feature_names, ends)


def _mdp(
    n_pairs: tuple[int, int],
    places: tuple[IntArray, IntArray, IntArray],
    probability: FloatArray,
    ends: IntArray,
    discount: float,
    *,
    learned: bool = False,
) -> Mdp:
    """The MDP of (E,) transitions, of which those from terminal states are not used."""
    kept = (probability != 0) & ~np.isin(places[0], ends)
    state, action, following = (
        np.concatenate([column[kept], added])
        for column, added in zip(places, (ends, np.zeros_like(ends), ends), strict=True)
    )
    if learned:
        return Mdp(learned_transitions(n_pairs, state, action, following), discount)
    known = np.concatenate([probability[kept], np.ones(len(ends))])
    return Mdp(fixed_transitions(n_pairs, state, action, following, known), discount)


def _problem(
    mdp: Mdp, features: Any, names: Sequence[str] | None, ends: IntArray
) -> TabularProblem:
    """The problem with (S, F) or (S, A, F) features, which count once in terminal states."""
    pairs = mdp.available.shape
    values = np.asarray(number_array("features", features), dtype=np.float64)
    if values.ndim == 2 and len(values) == pairs[0]:
        values = np.repeat(values[:, None, :], pairs[1], axis=1)
    if values.ndim != 3 or values.shape[:2] != pairs:
        raise SerdError(
            f"features must have shape ({pairs[0]}, F) or ({pairs[0]}, {pairs[1]}, F), got"
            f" {values.shape}; reshape them"
        )
    values = np.array(values)
    values[ends] *= 1.0 - mdp.discount
    numbered = tuple(f"feature {i}" for i in range(values.shape[2]))
    return TabularProblem(mdp, values, numbered if names is None else unique_names(names))


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


def _outcome_models(
    rows: list[list[list[Outcome]]], pairs: tuple[int, int], ends: IntArray, model_of: Any
) -> OutcomeModels:
    """Models whose outcome k is the k-th of each list; a certain outcome is all K outcomes."""
    n_outcomes = max(len(outcomes) for row in rows for outcomes in row)
    successors = np.full((*pairs, n_outcomes), -1, dtype=np.int64)
    for state, row in enumerate(rows):
        for action, outcomes in enumerate(row):
            reached = [following for _, following, _, _ in outcomes]
            if len(reached) not in (1, n_outcomes):
                raise SerdError(
                    f"P[{state}][{action}] must list 1 or {n_outcomes} outcomes where models are"
                    f" learned, got {len(reached)}; build OutcomeModels, or leave model_of out"
                )
            successors[state, action] = reached
    available = np.any(successors >= 0, axis=2)
    available[ends], successors[ends] = False, ends[:, None, None]
    available[ends, 0] = True
    which = int_array("model_of", model_of)
    which = np.full(pairs, which) if not which.ndim else int_array("model_of", which, pairs)
    return OutcomeModels(successors, which, available, n_models=int(which.max()) + 1)
