"""What a learner is given besides demonstrations: an MDP without reward, and reward features.

R(s, a) = theta_R . f(s, a). A terminal state of a table of transitions has one action, which stays;
its features count once, on arrival: staying for ever pays (1 - gamma) f each time, f in all.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from serd_core.arrays import (
    FloatArray,
    chosen_indices,
    float_array,
    number_array,
    require_kind,
    shown,
)
from serd_core.dynamics.outcome_models import fixed_transitions
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp


class Problem(Protocol):
    """Anything with an MDP and named features; see `TabularProblem` for the plain one."""

    @property
    def mdp(self) -> Mdp:
        """The MDP without its reward."""

    @property
    def features(self) -> FloatArray:
        """(S, A, F) finite features f(s, a); those of unavailable actions count nowhere."""

    @property
    def feature_names(self) -> tuple[str, ...]:
        """(F,) one name per feature."""


@dataclass(frozen=True, eq=False)
class TabularProblem:
    """What a learner is given besides decisions: an MDP, and features of which rewards are made.

    features: (S, A, F); feature_names: (F,), all different. R(s, a) = weights . features[s, a].
    Features of unavailable actions may be anything, NaN too; they are kept as 0.

        problem = sc.TabularProblem(sc.Mdp(models, 0.95), features, ("goal", "wall"))
    """

    mdp: Mdp
    features: FloatArray
    feature_names: tuple[str, ...]

    def __post_init__(self) -> None:
        require_kind("mdp", self.mdp, (Mdp,), "Mdp(models, 0.95)")
        object.__setattr__(self, "feature_names", unique_names(self.feature_names))
        if not self.feature_names:
            raise SerdError(
                "feature_names must name at least one feature, got none; a feature that is constant"
                " makes a null model"
            )
        shape = (self.mdp.n_states, self.mdp.n_actions, len(self.feature_names))
        given = number_array("features", self.features)
        if given.shape == shape:
            given = np.where(self.mdp.available[:, :, None], given, 0.0)
        object.__setattr__(self, "features", float_array("features", given, shape))


def require_problem(
    problem: object, has: str = "feature_names", example: str = "TabularProblem"
) -> None:
    """SerdError unless an argument is a problem that `has` an attribute besides its MDP."""
    if not (hasattr(problem, "mdp") and hasattr(problem, has)):
        raise SerdError(
            f"problem must have an mdp and {has}, got a {type(problem).__name__}; use for example a"
            f" {example}"
        )


def unique_names(names: Sequence[str]) -> tuple[str, ...]:
    """The names as a tuple; SerdError where two are equal, one is no text, or all are one text."""
    if isinstance(names, str):
        raise SerdError(
            f"feature_names must be a sequence of names, got {names!r}; use [{names!r}]"
        )
    for position, name in enumerate(names):
        if not isinstance(name, str):
            raise SerdError(f"feature_names must be texts, got {shown(name)}; use '{name}'")
        if name in names[:position]:
            raise SerdError(
                f"feature_names must differ from each other, got {name!r} twice; rename one"
            )
    return tuple(names)


def rewards(problem: Problem, reward_weights: FloatArray) -> FloatArray:
    """(S, A) rewards theta_R . f(s, a) for (F,) weights."""
    weights = float_array("reward_weights", reward_weights, (len(problem.feature_names),))
    return rewards_of(problem.features, weights)


def rewards_of(features: FloatArray, weights: FloatArray) -> FloatArray:
    """(S, A) rewards of (S, A, F) features."""
    return np.asarray(features @ weights)


def weights_gradient(features: FloatArray, by_reward: FloatArray) -> FloatArray:
    """(F,) sum of (S, A) gradients by the rewards times the features."""
    return np.tensordot(by_reward, features, axes=2)


def usable_features(problem: Problem) -> FloatArray:
    """(N, F) features of the available pairs."""
    return problem.features[problem.mdp.available]


def from_transitions(
    transitions: Any,
    features: Any,
    *,
    discount: float,
    feature_names: Sequence[str] | None = None,
    terminal: Iterable[int] = (),
) -> TabularProblem:
    """Make a learning problem from a table of known transitions.

    transitions: (S, A, S) array. Pairs (s, a) without entries are not available.
    features: (S, F) of states or (S, A, F) of pairs; feature_names: (F,), None numbers them.
    discount: gamma in [0, 1) per decision.
    terminal: states in which an episode ends, or an (S,) mask of them; their features count once.

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
    state, action, following = np.nonzero(kept)
    n_states, n_actions, _ = dense.shape
    chances = kept[state, action, following]
    known = fixed_transitions((n_states, n_actions), state, action, following, chances)
    mdp = Mdp(known, discount)
    values = np.asarray(number_array("features", features), dtype=np.float64)
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
    return TabularProblem(
        mdp, values, numbered if feature_names is None else unique_names(feature_names)
    )
