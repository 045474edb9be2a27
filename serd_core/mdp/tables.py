"""Learning problems from tables of transitions.

A terminal state gets one action, which stays. Its features count once, on arrival: staying for ever
pays (1 - gamma) f each time, which is f in all. Transitions given from it are not used, nor are
their features. A pair (s, a) without transitions is not available.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from serd_core.arrays import (
    chosen_indices,
    float_array,
    number_array,
    shown,
)
from serd_core.dynamics.sparse_model import fixed_transitions, learned_transitions
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem


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
    # A terminal state has one action, which stays.
    kept = np.where(np.isin(np.arange(len(dense)), ends)[:, None, None], 0.0, dense)
    kept[ends, 0, ends] = 1.0
    entries = np.nonzero(kept)
    if learned:
        mdp = Mdp(learned_transitions(dense.shape[:2], *entries), discount)
    else:
        mdp = Mdp(fixed_transitions(dense.shape[:2], *entries, kept[entries]), discount)
    values = np.asarray(number_array("features", features), dtype=np.float64)
    n_states, n_actions, _ = dense.shape
    if values.ndim == 2 and len(values) == n_states:
        values = np.repeat(values[:, None, :], n_actions, axis=1)
    if values.ndim != 3 or values.shape[:2] != (n_states, n_actions):
        raise SerdError(
            f"features must have shape ({n_states}, F) or ({n_states}, {n_actions}, F), got"
            f" {values.shape}; reshape them"
        )
    values = np.array(values)
    values[ends] *= 1.0 - mdp.discount
    numbered = tuple(f"feature {i}" for i in range(values.shape[2]))
    return TabularProblem(mdp, values, numbered if feature_names is None else feature_names)
