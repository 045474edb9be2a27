"""What every parameterised transition model offers to solvers, likelihoods and priors.

Index order everywhere: [s, a, k] for outcomes, [s, a, s'] for transitions; a *row* is the pair
`s * n_actions + a`. A model has a fixed sparse structure of E *entries*; entry e belongs to one row
and one successor, several entries of a row may share a successor, and

    P(s' | s, a) = sum of the entries of row (s, a) whose successor is s'.

Entries are linear in the model's *local probabilities* (the numbers that are reported, e.g. one
table of outcomes per local model), which are a smooth function of its parameter vector.

Functions sum_g h_g(P_g) of the distinct transitions g = (s, a, s') have the second derivatives

    d2 sum h(P) = sum h'(P) d2 P + sum h''(P) dP dP^T

For h = c log P, the log-likelihood of counts c, h' = c / P and h'' = -c / P^2.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # loads sparse at its first use

from serd_core.arrays import BoolArray, FloatArray, IntArray, floored, weighted_counts
from serd_core.bellman.policy_pattern import PolicyPattern, index_type, policy_pattern, with_numbers
from serd_core.checks import number_array
from serd_core.display import Record
from serd_core.errors import SerdError

#: By which a probability or a sum of them may be off.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class TransitionGroups:
    """G distinct transitions, sorted by row, then successor.

    group_of_entry: (E,); row, successor: (G,).
    """

    group_of_entry: IntArray
    row: IntArray
    successor: IntArray
    n_states: int

    def __len__(self) -> int:
        return len(self.row)

    def probabilities(self, entries: FloatArray) -> FloatArray:
        """(G,) probability of each distinct transition."""
        return weighted_counts(self.group_of_entry, entries, len(self))

    def places(self, key: IntArray) -> IntArray:
        """(N,) group of each transition with the given key, -1 where the structure has none."""
        return places_of(key, self.row * self.n_states + self.successor)


def places_of(wanted: IntArray, keys: IntArray) -> IntArray:
    """Place of each wanted key among sorted ones, -1 where it is none of them."""
    if not len(keys):
        return np.full(np.shape(wanted), -1, dtype=np.int64)
    place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    return np.where(keys[place] == wanted, place, -1)


class TransitionModel(Record, ABC):
    """Sparse P(s' | s, a) as a smooth function of a parameter vector, empty unless overridden.

    available: (S, A) which actions exist in which states; other rows have no entries.
    """

    available: BoolArray

    @property
    @abstractmethod
    def row_length(self) -> IntArray:
        """(S, A) number of entries of each row."""

    @cached_property
    def row_start(self) -> IntArray:
        """(S*A + 1,) first entry of each row."""
        return np.concatenate([[0], np.cumsum(self.row_length)])

    @property
    @abstractmethod
    def successor(self) -> IntArray:
        """(E,) next state of each entry."""

    @property
    def n_parameters(self) -> int:
        """Length of the parameter vector."""
        return 0

    @abstractmethod
    def local_probabilities(self, parameters: FloatArray) -> FloatArray:
        """The model's local probabilities at `parameters` (n_parameters,)."""

    def pull_back(self, parameters: FloatArray, local_gradient: FloatArray) -> FloatArray:
        """(n_parameters,) vector-Jacobian product of `local_probabilities`."""
        del parameters, local_gradient
        return np.zeros(0)

    @property
    @abstractmethod
    def local_shape(self) -> tuple[int, ...]:
        """Shape of the local probabilities."""

    @abstractmethod
    def _require_table(self, table: FloatArray) -> None:
        """SerdError where local probabilities have another shape."""

    def entries(self, local_probabilities: FloatArray) -> FloatArray:
        """(E,) entries for given local probabilities (linear)."""
        self._require_table(local_probabilities)
        return np.ravel(local_probabilities)[self.local_index]

    def gather(self, entry_gradient: FloatArray) -> FloatArray:
        """Gradient by local probabilities of a function with the given (E,) entry gradient."""
        size = int(np.prod(self.local_shape))
        return weighted_counts(self.local_index, entry_gradient, size).reshape(self.local_shape)

    @abstractmethod
    def parameters_of(self, initial: FloatArray) -> FloatArray:
        """(n_parameters,) parameters for given initial dynamics, in the model's own terms."""

    def fixed_parameters_of(self, known: FloatArray) -> FloatArray:
        """(n_parameters,) the same for dynamics that stay as they are; they may hold zeros."""
        return self.parameters_of(known)

    def known_probabilities(self, known: FloatArray) -> FloatArray:
        """The local probabilities of dynamics given in the model's own terms."""
        return self.local_probabilities(self.fixed_parameters_of(known))

    @property
    def moves(self) -> TransitionModel:
        """The model of where moves lead, without how long they take, of the same parameters."""
        return self

    def largest_sum(self, local_probabilities: FloatArray) -> float:
        """Largest sum of a row; T contracts by the discount times this."""
        del local_probabilities
        return 1.0

    def require_discount(self, discount: float) -> None:
        """SerdError where the model is one for another discount."""
        del discount

    @property
    @abstractmethod
    def local_index(self) -> IntArray:
        """(E,) which of the flattened local probabilities each entry is."""

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """(n_parameters,) one name per parameter, for reports."""
        return ()

    @property
    def gauge(self) -> FloatArray:
        """(g, n_parameters) directions in which parameters move without changing P; none here."""
        return np.zeros((0, self.n_parameters))

    def local_jacobian(self, parameters: FloatArray) -> FloatArray:
        """(L, n_parameters) derivative of the flattened local probabilities."""
        del parameters
        return np.zeros((int(np.prod(self.local_shape)), 0))

    def local_curvature(self, parameters: FloatArray, local_gradient: FloatArray) -> FloatArray:
        """(n, n) second derivatives of local_gradient . local_probabilities."""
        del parameters, local_gradient
        return np.zeros((0, 0))

    @property
    def n_states(self) -> int:
        """Number of states S."""
        return int(self.available.shape[0])

    @property
    def n_actions(self) -> int:
        """Number of actions A."""
        return int(self.available.shape[1])

    @property
    def n_entries(self) -> int:
        """Number of entries E."""
        return len(self.successor)

    @cached_property
    def row(self) -> IntArray:
        """(E,) row s * n_actions + a of each entry."""
        return np.repeat(np.arange(self.available.size), self.row_length.ravel())

    @cached_property
    def groups(self) -> TransitionGroups:
        """Entries grouped by their distinct transition (s, a, s')."""
        n_states = self.n_states
        keys, place = np.unique(self.row * n_states + self.successor, return_inverse=True)
        return TransitionGroups(place.reshape(-1), keys // n_states, keys % n_states, n_states)

    @cached_property
    def absorbing(self) -> BoolArray:
        """(S,) states that no available action can leave, for any parameters."""
        state = self.row // self.n_actions
        return ~np.isin(np.arange(self.n_states), state[self.successor != state])

    @cached_property
    def structure(self) -> scipy.sparse.csr_array:
        """(S*A, S) places of the entries; duplicates of a successor add up."""
        kind = index_type(max(self.n_entries, self.n_states))
        places = self.successor.astype(kind), self.row_start.astype(kind)
        ones = np.ones(self.n_entries, dtype=np.int8)
        return scipy.sparse.csr_array((ones, *places), shape=(self.available.size, self.n_states))

    @cached_property
    def policy_pattern(self) -> PolicyPattern:
        """Symbolic structure of I - gamma P_pi, the same for all policies and parameters."""
        return policy_pattern(self.row, self.successor, self.n_states, self.n_actions)

    def require_transitions(self, local_probabilities: FloatArray) -> None:
        """SerdError naming the first (s, a) whose probabilities are no distribution."""
        entries = self.entries(local_probabilities)
        if (bad := np.flatnonzero(~(np.isfinite(entries) & (entries >= -_ROUNDING)))).size:
            self._reject(int(self.row[bad[0]]), f"has an entry of {entries[bad[0]]}")
        sums = weighted_counts(self.row, entries, self.available.size)
        given = self.row_length.ravel() > 0
        if (wrong := np.flatnonzero(given & (np.abs(sums - 1.0) > _ROUNDING))).size:
            self._reject(int(wrong[0]), f"sums to {sums[wrong[0]]}")

    def _reject(self, row: int, problem: str) -> None:
        state, action = divmod(row, self.n_actions)
        raise SerdError(
            f"transition probabilities of state {state}, action {action} must be non-negative and"
            f" sum to 1, but the row {problem}; normalise that row in float64"
        )


@dataclass(frozen=True, eq=False)
class Transitions:
    """A transition model with its local probabilities."""

    model: TransitionModel
    local_probabilities: FloatArray

    @cached_property
    def entries(self) -> FloatArray:
        """(E,) entries of P."""
        return self.model.entries(self.local_probabilities)

    @cached_property
    def matrix(self) -> scipy.sparse.csr_array:
        """(S*A, S) sparse matrix of P(s' | s, a)."""
        return with_numbers(self.model.structure, self.entries)

    def expected(self, values: FloatArray) -> FloatArray:
        """(S, A) expectation sum_s' P(s'|s,a) values(s'); 0 where an action is unavailable."""
        expected: FloatArray = self.matrix @ values
        return expected.reshape(self.model.available.shape)

    def flow(self, weights: FloatArray) -> FloatArray:
        """(S,) transposed product sum_{s,a} P(s'|s,a) weights(s,a)."""
        return np.asarray(self.matrix.T @ weights.ravel())

    def local_gradient(self, weights: FloatArray, values: FloatArray) -> FloatArray:
        """Gradient of sum weights(s, a) P(s' | s, a) values(s') by the local probabilities."""
        by_entry = np.take(weights.ravel(), self.model.row)
        by_entry *= np.take(values, self.model.successor)
        return self.model.gather(by_entry)


def transitions_at(model: TransitionModel, parameters: FloatArray) -> Transitions:
    """The model's transitions at (n_parameters,) parameters."""
    return Transitions(model, model.local_probabilities(parameters))


def transitions_of(model: TransitionModel, local_probabilities: FloatArray | None) -> Transitions:
    """The transitions of given local probabilities; SerdError where a row is no distribution.

    local_probabilities: None for a model without parameters.
    """
    if local_probabilities is None:
        if model.n_parameters:
            raise SerdError(
                f"outcome_probabilities must be given for a model with {model.n_parameters}"
                " parameters, got None; pass those of a fit or of the truth"
            )
        local_probabilities = model.local_probabilities(np.zeros(0))
    given = number_array("outcome_probabilities", local_probabilities)
    transitions = Transitions(model, np.asarray(given, dtype=np.float64))
    model.require_transitions(transitions.local_probabilities)
    return transitions


def transition_probabilities(model: TransitionModel, theta: FloatArray) -> FloatArray:
    """(G,) probability of each distinct transition, with a positive floor."""
    moves = model.moves
    return floored(moves.groups.probabilities(moves.entries(moves.local_probabilities(theta))))


def dynamics_gradient(
    model: TransitionModel, theta: FloatArray, group_gradient: FloatArray
) -> FloatArray:
    """(N,) gradient by the parameters for a (G,) gradient by distinct transitions."""
    moves, entry_gradient = model.moves, group_gradient[model.groups.group_of_entry]
    return moves.pull_back(theta, moves.gather(entry_gradient))


def log_transition_hessian(
    model: TransitionModel, theta: FloatArray, counts: FloatArray
) -> FloatArray:
    """(N, N) of sum c_g log P_g for (G,) counts of the model's distinct transitions."""
    present = transition_probabilities(model, theta)
    ratio = counts / present
    return transition_hessian(model, theta, ratio, -ratio / present)


def transition_hessian(
    model: TransitionModel, theta: FloatArray, first: FloatArray, second: FloatArray
) -> FloatArray:
    """(N, N) of sum h_g(P_g) for (G,) first and second derivatives of h."""
    moves, bent = model.moves, np.flatnonzero(second)
    by_local = moves.gather(first[moves.groups.group_of_entry])
    slopes = transition_jacobian(model, theta, bent)
    bend = (slopes * second[bent][:, None]).T @ slopes
    return np.asarray(moves.local_curvature(theta, by_local) + bend)


def transition_jacobian(
    model: TransitionModel, theta: FloatArray, wanted: IntArray | slice = slice(None)
) -> FloatArray:
    """(n, N) derivative of the (n,) wanted of the G transitions by the parameters."""
    moves = model.moves
    local_jacobian = moves.local_jacobian(theta)
    choose = scipy.sparse.csr_array(
        (np.ones(len(moves.local_index)), (moves.groups.group_of_entry, moves.local_index)),
        shape=(len(moves.groups), len(local_jacobian)),
    )
    return np.asarray(choose[wanted] @ local_jacobian)
