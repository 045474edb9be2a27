"""What a learner is given besides demonstrations: an MDP without reward, and reward features.

R(s, a) = theta_R . f(s, a). A terminal state of a table of transitions has one action, which stays;
its features count once, on arrival: staying for ever pays (1 - gamma) f each time, f in all.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import index
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from serd_core import checks
from serd_core.arrays import FloatArray, IntArray
from serd_core.display import Record
from serd_core.dynamics.outcome_models import OutcomeModels, SparseModel, fixed_transitions
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


@dataclass(frozen=True, eq=False, repr=False)
class TabularProblem(Record):
    """What a learner is given besides decisions: an MDP, and features of which rewards are made.

    features: (S, A, F); feature_names: (F,), all different. R(s, a) = weights . features[s, a].
    Features of unavailable actions may be anything, NaN too; they are kept as 0.

        problem = sc.TabularProblem(sc.Mdp(models, 0.95), features, ("goal", "wall"))
    """

    mdp: Mdp
    features: FloatArray
    feature_names: tuple[str, ...]

    def __post_init__(self) -> None:
        checks.require_kind("mdp", self.mdp, (Mdp,), "Mdp(models, 0.95)")
        object.__setattr__(self, "feature_names", unique_names(self.feature_names))
        if not self.feature_names:
            raise SerdError(
                "feature_names must name at least one feature, got none; a feature that is constant"
                " makes a null model"
            )
        shape = (self.mdp.n_states, self.mdp.n_actions, len(self.feature_names))
        given = checks.number_array("features", self.features)
        if given.shape == shape:
            given = np.where(self.mdp.available[:, :, None], given, 0.0)
        object.__setattr__(self, "features", checks.float_array("features", given, shape))


def require_problem(
    problem: object, has: str = "feature_names", example: str = "TabularProblem"
) -> None:
    """SerdError unless an argument is a problem that `has` an attribute besides its MDP."""
    if not (hasattr(problem, "mdp") and hasattr(problem, has)):
        raise SerdError(
            f"problem must have an mdp and {has}, got a {type(problem).__name__}"
            f"{checks.misplaced(problem)}; pass the problem first, for example a {example}"
        )


def unique_names(names: Sequence[str]) -> tuple[str, ...]:
    """The names as a tuple; SerdError where two are equal, one is no text, or all are one text."""
    if isinstance(names, str):
        raise SerdError(
            f"feature_names must be a sequence of names, got {names!r}; use [{names!r}]"
        )
    for position, name in enumerate(names):
        if not isinstance(name, str) or name in names[:position]:
            raise SerdError(f"feature_names must be texts that differ, got {name!r}; rename one")
    return tuple(names)


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
    dense = checks.float_array("transitions", transitions, (None, None, None))
    if dense.shape[0] != dense.shape[2]:
        raise SerdError(
            f"transitions must have shape (states, actions, states), got {dense.shape}; transpose"
            " them"
        )
    listed = list(terminal) if isinstance(terminal, Iterable) else terminal
    ends = np.unique(checks.chosen_indices("terminal", listed, len(dense), "a state"))
    places = np.nonzero(dense)
    mdp = Mdp(_known(dense.shape[:2], places, dense[places], ends), discount)
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
    features: (S, F) of states or (S, A, F) of pairs; feature_names: (F,), None numbers them.
    discount: gamma in [0, 1) per decision.
    model_of: None for dynamics that are known; else outcome models are learned, and the k-th entry
    of each list is their outcome k: one number, or (S, A) of the model of each pair. A list of one
    entry is certain. Features must then be given. SerdError for an environment without a table.

        problem = sc.from_gymnasium(gymnasium.make("FrozenLake-v1"), discount=0.99)
    """
    pairs, columns = _gymnasium_table(environment)
    state, action, following, outcome, chance, reward, done = columns
    checks.require_index("next_state", following, pairs[0], "a state")
    ends = np.unique(following[done])
    model: OutcomeModels | SparseModel
    if model_of is not None:
        model = _outcome_models(pairs, (state, action, outcome, following), ends, model_of)
    else:
        model = _known(pairs, (state, action, following), chance, ends)
        if features is None:
            features, feature_names = np.zeros((*pairs, 1)), feature_names or ("reward",)
            np.add.at(features[..., 0], (state, action), reward * chance)
            features[ends] = 0.0
    return _problem(Mdp(model, discount), features, feature_names, ends)


def _known(
    n_pairs: tuple[int, ...], places: tuple[IntArray, ...], probability: FloatArray, ends: IntArray
) -> SparseModel:
    """The model of (E,) transitions, of which those from terminal states are not used."""
    kept = (probability != 0) & ~np.isin(places[0], ends)
    state = np.append(places[0][kept], ends)
    action = np.append(places[1][kept], np.zeros_like(ends))
    following = np.append(places[2][kept], ends)
    known = np.append(probability[kept], np.ones(len(ends)))
    return fixed_transitions((n_pairs[0], n_pairs[1]), state, action, following, known)


def _problem(
    mdp: Mdp, features: Any, names: Sequence[str] | None, ends: IntArray
) -> TabularProblem:
    """The problem with (S, F) or (S, A, F) features, which count once in terminal states."""
    n_states, n_actions = mdp.available.shape
    values = np.asarray(checks.number_array("features", features), dtype=np.float64)
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
    return TabularProblem(mdp, values, numbered if names is None else unique_names(names))


def _gymnasium_table(environment: Any) -> tuple[tuple[int, int], list[NDArray[Any]]]:
    """(S, A), and (E,) state, action, next state, place in its list, chance, reward and end."""
    table: Any = getattr(getattr(environment, "unwrapped", environment), "P", None)
    try:
        pairs = len(table), max(len(table[state]) for state in range(len(table)))
        # 0.0 + refuses text, which float() reads.
        listed = [
            (state, action, index(after), k, float(0.0 + chance), float(0.0 + reward), bool(done))
            for state in range(len(table))
            for action in range(len(table[state]))
            for k, (chance, after, reward, done) in enumerate(table[state][action])
        ]
        # Unpacking refuses an empty list.
        first, *others = zip(*listed, strict=True)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise SerdError(
            "environment must have a table P, as FrozenLake, Taxi and CliffWalking have, of lists"
            " of outcomes (probability, next state, reward, terminated) for states and actions"
            f" numbered from 0, got {checks.shown(table)}; use from_transitions"
        ) from error
    return pairs, [np.array(column) for column in (first, *others)]


def _outcome_models(
    pairs: tuple[int, int], columns: tuple[IntArray, ...], ends: IntArray, model_of: Any
) -> OutcomeModels:
    successors = np.full((*pairs, int(columns[2].max()) + 1), -1)
    successors[columns[:3]] = columns[3]
    certain = np.sum(successors >= 0, axis=2) == 1
    successors[certain] = successors[certain].max(axis=1, keepdims=True)
    successors[ends] = ends[:, None, None]
    available = np.any(successors >= 0, axis=2)
    available[ends] = np.arange(pairs[1]) == 0
    which = checks.int_array(
        "model_of", model_of if np.ndim(model_of) else np.full(pairs, model_of)
    )
    return OutcomeModels(successors, which, available, int(which.max(initial=0)) + 1)
