"""Transition models: outcomes that states share (Eq. 5.1), and known transitions entry by entry.

    P_m(k) = exp(beta theta_mk) / sum_j exp(beta theta_mj)                    (5.1)
    P(s' | s, a) = sum_k P_m(k) [successors[s, a, k] = s'],  m = model_of[s, a]

The toy example (one model per state and action), the gridworld (9 models of 5 outcomes) and the
hallway (4 of 5) are of this form. The parameter vector is theta, row-major (M * K,). Transitions
entry by entry are known and have no parameters.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from serd_core import checks
from serd_core.arrays import BoolArray, FloatArray, IntArray, padded
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError

#: How far the sum of a row may be from 1: rounding, no more.
SUM_TOLERANCE = 1e-9
#: Scaled energy, below that of a certain outcome, at which exp() is exactly 0: it is from 746 on.
IMPOSSIBLE = 1000.0


@dataclass(frozen=True, eq=False, repr=False)
class OutcomeModels(TransitionModel):
    """Dynamics to learn that pairs (s, a) share: M local distributions over K outcomes (5.1).

    P_m(k) = exp(beta theta_mk) / sum_j exp(beta theta_mj), with the energies theta as parameters.
    successors: (S, A, K) next state of each outcome (ignored where not available).
    model_of: (S, A) local model of each state and action (ignored where not available).
    available: (S, A) mask of actions that exist.
    n_models: M; beta: scale of the energies.
    intended: (M,) outcome that the actions of each model are named after, None where there is none.
    Where actions are hidden, renaming actions and outcomes alike often changes no likelihood; fits
    then start where the intended outcomes are the most likely ones.
    n_others: further numbers of the parameter vector, on which no outcome depends.

    Raises SerdError naming the first entry that is no state or no model.

        models = sc.OutcomeModels(  # one state, whose one action has one outcome
            successors=[[[0]]], model_of=[[0]], available=[[True]], n_models=1)
    """

    successors: IntArray
    model_of: IntArray
    available: BoolArray
    n_models: int
    beta: float = 1.0
    intended: IntArray | None = None
    n_others: int = 0

    def __post_init__(self) -> None:
        successors = checks.int_array("successors", self.successors, (None, None, None))
        pairs = successors.shape[:2]
        available = checks.bool_array("available", self.available, pairs)
        model_of = checks.int_array("model_of", self.model_of, pairs)
        checks.require_positive("beta", self.beta, "use 1.0")
        if not successors.size:
            raise SerdError(
                f"successors must hold a state, an action and an outcome, got shape"
                f" {successors.shape}; give each state an action"
            )
        count = self.n_models
        if not (checks.is_number(count) and count >= 1 and float(count).is_integer()):
            raise SerdError(
                f"n_models must be a whole number of at least 1, got {checks.shown(count)};"
                " count the rows of the outcome table"
            )
        checks.require_index("successors", successors, pairs[0], "a state", available[:, :, None])
        checks.require_index("model_of", model_of, self.n_models, "a model", available)
        if self.intended is not None:
            intended = checks.int_array("intended", self.intended, (self.n_models,))
            checks.require_index("intended", intended, successors.shape[2], "an outcome")
            object.__setattr__(self, "intended", intended)
        object.__setattr__(self, "successors", successors)
        object.__setattr__(self, "model_of", model_of)
        object.__setattr__(self, "available", available)

    @property
    def n_outcomes(self) -> int:
        """Number of outcomes K."""
        return int(self.successors.shape[2])

    @property
    def local_shape(self) -> tuple[int, ...]:
        return self.n_models, self.n_outcomes

    @cached_property
    def n_energies(self) -> int:
        """M * K."""
        return self.n_models * self.n_outcomes

    @property
    def n_parameters(self) -> int:
        """M * K energies and the other numbers."""
        return self.n_energies + self.n_others

    @cached_property
    def row_length(self) -> IntArray:
        return self.available * np.int64(self.n_outcomes)

    @cached_property
    def successor(self) -> IntArray:
        return self.successors[self.available].ravel()

    @cached_property
    def local_index(self) -> IntArray:
        """(E,) place of each entry's probability in the flattened (M, K) table."""
        first = self.model_of[self.available] * self.n_outcomes
        return np.asarray((first[:, None] + np.arange(self.n_outcomes)).ravel())

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return tuple(
            f"model {m} outcome {k}" for m in range(self.n_models) for k in range(self.n_outcomes)
        )

    @property
    def gauge(self) -> FloatArray:
        """(M, M*K) adding a constant to all energies of a model changes nothing."""
        same = np.kron(np.eye(self.n_models), np.ones((1, self.n_outcomes)))
        return padded(same, (self.n_models, self.n_parameters))

    def local_jacobian(self, parameters: FloatArray) -> FloatArray:
        """(M*K, N) derivative of the probabilities by the energies (5.2)."""
        p = self.local_probabilities(parameters)
        slope = self.beta * p[:, :, None] * (np.eye(self.n_outcomes) - p[:, None, :])
        return padded(self._by_model(slope), (self.n_energies, self.n_parameters))

    def local_curvature(self, parameters: FloatArray, local_gradient: FloatArray) -> FloatArray:
        """(N, N) second derivatives of local_gradient . probabilities by the energies."""
        p = self.local_probabilities(parameters)
        pull = p * (local_gradient - np.sum(p * local_gradient, axis=1, keepdims=True))
        mixed = p[:, :, None] * pull[:, None, :]
        own = np.eye(self.n_outcomes) * pull[:, :, None]
        bend = self.beta**2 * (own - mixed - mixed.transpose(0, 2, 1))
        return padded(self._by_model(bend), (self.n_parameters, self.n_parameters))

    def _by_model(self, blocks: FloatArray) -> FloatArray:
        """(M*K, M*K) matrix of (M, K, K) blocks on its diagonal."""
        table = np.zeros((self.n_models, self.n_outcomes) * 2)
        each = np.arange(self.n_models)
        table[each, :, each, :] = blocks
        return table.reshape(self.n_energies, self.n_energies)

    def energies(self, parameters: FloatArray) -> FloatArray:
        """(..., M, K) energies theta_mk of (..., N) parameters."""
        given = np.asarray(parameters)[..., : self.n_energies]
        return given.reshape(*given.shape[:-1], self.n_models, self.n_outcomes)

    def local_probabilities(self, parameters: FloatArray) -> FloatArray:
        """(..., M, K) outcome probabilities P_m(k) of (..., N) parameters (5.1)."""
        energies = self.beta * self.energies(parameters)
        weights = np.exp(energies - energies.max(axis=-1, keepdims=True))
        return np.asarray(weights / weights.sum(axis=-1, keepdims=True))

    def pull_back(self, parameters: FloatArray, local_gradient: FloatArray) -> FloatArray:
        """(N,) gradient by the energies for an (M, K) gradient by the probabilities (5.2)."""
        probabilities = self.local_probabilities(parameters)
        mean = np.sum(probabilities * local_gradient, axis=1, keepdims=True)
        by_energy = self.beta * probabilities * (local_gradient - mean)
        return padded(by_energy.ravel(), (self.n_parameters,))

    def parameters_of(self, initial: FloatArray) -> FloatArray:
        """(M*K,) energies of the given (M, K) positive probabilities, zero mean per model."""
        probabilities = self.known_probabilities(initial)
        rule = "be above 0 to have a finite energy"
        fix = "use a positive pseudo-count, or FixedBelief() where dynamics are not learned"
        checks.require_each("probabilities", probabilities, probabilities > 0, rule, fix)
        energies = np.log(probabilities) / self.beta
        centred = np.asarray(energies - energies.mean(axis=1, keepdims=True)).ravel()
        return padded(centred, (self.n_parameters,))

    def fixed_parameters_of(self, known: FloatArray) -> FloatArray:
        """(M*K,) energies of (M, K) probabilities; outcomes of probability 0 keep exactly that.

        Such energies suit dynamics that are not learned: their gradient is 0, too.
        """
        probabilities = self.known_probabilities(known)
        possible = probabilities > 0
        scaled = np.log(probabilities, out=np.full_like(probabilities, -IMPOSSIBLE), where=possible)
        mean = np.mean(scaled, axis=1, keepdims=True, where=possible)
        return padded(np.asarray((scaled - mean) / self.beta).ravel(), (self.n_parameters,))

    def known_probabilities(self, known: FloatArray) -> FloatArray:
        """The (M, K) table itself; SerdError where a row, of a model in use or not, is wrong."""
        name, table = "outcome probabilities", np.asarray(known, dtype=np.float64)
        self._require_table(table)
        possible = np.isfinite(table) & (table >= 0)
        checks.require_each(name, table, possible, "be finite and not negative", "repair that row")
        sums = np.sum(table, axis=1)
        is_one = np.abs(sums - 1.0) <= SUM_TOLERANCE
        checks.require_each(name, sums, is_one, "sum to 1", "normalise that row")
        return table

    def _require_table(self, table: FloatArray) -> None:
        if np.shape(table) != self.local_shape:
            raise SerdError(
                f"outcome probabilities must have shape {self.local_shape} (models, outcomes),"
                f" got {np.shape(table)}; pass one row per local model"
            )


@dataclass(frozen=True, eq=False, repr=False)
class SparseModel(TransitionModel):
    """Known transitions given entry by entry.

    n_pairs: (S, A); state, action, next_state, known: (E,) of each entry with its probability, in
    any order. Pairs without entries are not available.
    """

    n_pairs: tuple[int, int]
    state: IntArray
    action: IntArray
    next_state: IntArray
    known: FloatArray

    def __post_init__(self) -> None:
        n_entries = len(np.atleast_1d(self.state))
        pairs = checks.int_array("n_pairs", self.n_pairs, (2,))
        if pairs.min() < 1:
            raise SerdError(
                f"n_pairs must be at least one state and one action, got {self.n_pairs};"
                " pass (S, A)"
            )
        object.__setattr__(self, "n_pairs", (int(pairs[0]), int(pairs[1])))
        checks.require_memory(
            f"a table of {pairs[0]} states and {pairs[1]} actions",
            checks.BYTES_PER_PAIR * float(pairs[0]) * float(pairs[1]),
            "number states and actions from 0 without gaps",
        )
        sizes = {"state": pairs[0], "action": pairs[1], "next_state": pairs[0]}
        for name, size in sizes.items():
            column = checks.int_array(name, getattr(self, name), (n_entries,))
            checks.require_index(name, column, size, f"a {name.replace('_', ' ')}")
            object.__setattr__(self, name, column)

    @cached_property
    def _row(self) -> IntArray:
        """(E,) pair of each entry, in the order given."""
        return np.asarray(self.state * self.n_pairs[1] + self.action)

    @property
    def local_shape(self) -> tuple[int, ...]:
        return self.state.shape

    @cached_property
    def available(self) -> BoolArray:  # type: ignore[override]  # derived here, given elsewhere
        """(S, A) pairs that have entries."""
        return self.row_length > 0

    @cached_property
    def local_index(self) -> IntArray:
        """(E,) the user's number of each entry."""
        return np.argsort(self._row, kind="stable")

    @cached_property
    def row_length(self) -> IntArray:
        n_pairs = self.n_pairs[0] * self.n_pairs[1]
        return np.bincount(self._row, minlength=n_pairs).reshape(self.n_pairs)

    @cached_property
    def successor(self) -> IntArray:
        return np.asarray(self.next_state[self.local_index])

    def local_probabilities(self, parameters: FloatArray) -> FloatArray:
        """(E,) probabilities, in the order given."""
        del parameters
        return self.known

    def parameters_of(self, initial: FloatArray) -> FloatArray:
        """(0,) none; SerdError where some are given."""
        if np.size(initial):
            raise SerdError(
                "dynamics must be None for known transitions, which have no parameters, got shape"
                f" {np.shape(initial)}; leave dynamics out"
            )
        return np.zeros(0)

    def _require_table(self, table: FloatArray) -> None:
        if np.shape(table) != self.state.shape:
            raise SerdError(
                f"probabilities must have shape {self.state.shape}, one per entry, got"
                f" {np.shape(table)}; pass them in the order of state and action"
            )


def fixed_transitions(
    n_pairs: tuple[int, int],
    state: IntArray,
    action: IntArray,
    next_state: IntArray,
    probability: FloatArray,
) -> SparseModel:
    """Make known transitions from their entries, which must sum to 1 for each pair (s, a).

    n_pairs: (S, A); state, action, next_state, probability: (E,). Pairs without entries are not
    available. SerdError for an index outside these, or another sum.

        stays = sc.Mdp(sc.fixed_transitions((2, 1), [0, 1], [0, 0], [0, 1], [1.0, 1.0]), 0.9)
    """
    known = checks.float_array("probability", probability, (len(np.atleast_1d(state)),))
    model = SparseModel(n_pairs, state, action, next_state, known)
    model.require_transitions(known)
    return model
