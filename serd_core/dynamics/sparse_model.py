"""A general sparse P(s' | s, a) with a parameterisation of the user's own.

The local probabilities are the entries themselves; learners are given the parameters. It takes a
smooth map from parameters to entries and its vector-Jacobian product; `fixed_transitions` has no
parameters, `learned_transitions` the log odds of a distribution of its own for each pair (s, a).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from serd_core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    first_index,
    float_array,
    int_array,
    require_count,
    require_index,
)
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError
from serd_core.memory import BYTES_PER_PAIR, require_memory


@dataclass(frozen=True, eq=False)
class SparseModel(TransitionModel):
    """Transitions given entry by entry, with a parameterisation of the user's own.

    n_pairs: (S, A); state, action, next_state: (E,) of each entry, in any order.
    probabilities: parameters (n_parameters,) -> (E,) entries in that order.
    vector_jacobian: (parameters, (E,) gradient) -> (n_parameters,) gradient.
    Pairs without entries are not available.
    """

    n_pairs: tuple[int, int]
    state: IntArray
    action: IntArray
    next_state: IntArray
    parameter_count: int
    probabilities: Callable[[FloatArray], FloatArray]
    vector_jacobian: Callable[[FloatArray, FloatArray], FloatArray]

    def __post_init__(self) -> None:
        n_entries = len(np.atleast_1d(self.state))
        pairs = int_array("n_pairs", self.n_pairs, (2,))
        if pairs.min() < 1:
            raise SerdError(
                f"n_pairs must be at least one state and one action, got {self.n_pairs};"
                " pass (S, A)"
            )
        object.__setattr__(self, "n_pairs", (int(pairs[0]), int(pairs[1])))
        require_memory(
            f"a table of {pairs[0]} states and {pairs[1]} actions",
            BYTES_PER_PAIR * float(pairs[0]) * float(pairs[1]),
            "number states and actions from 0 without gaps",
        )
        require_count("parameter_count", self.parameter_count, 0, "0 for known transitions")
        sizes = {"state": pairs[0], "action": pairs[1], "next_state": pairs[0]}
        for name, size in sizes.items():
            column = int_array(name, getattr(self, name), (n_entries,))
            require_index(name, column, size, f"a {name.replace('_', ' ')}")
            object.__setattr__(self, name, column)

    @property
    def n_parameters(self) -> int:
        return self.parameter_count

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
        return np.argsort(self.state * self.n_pairs[1] + self.action, kind="stable")

    @cached_property
    def row_length(self) -> IntArray:
        row = self.state * self.n_pairs[1] + self.action
        return np.bincount(row, minlength=self.n_pairs[0] * self.n_pairs[1]).reshape(self.n_pairs)

    @cached_property
    def successor(self) -> IntArray:
        return np.asarray(self.next_state[self.local_index])

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return tuple(f"parameter {i}" for i in range(self.parameter_count))

    def local_probabilities(self, parameters: FloatArray) -> FloatArray:
        """(E,) the user's probabilities, in the user's order."""
        # Copies, so that functions that write into arguments or reuse an array change nothing here.
        given = np.array(self.probabilities(np.array(parameters)), dtype=np.float64)
        _require_shape("probabilities(parameters)", given, self.state.shape, "entry")
        return given

    def pull_back(self, parameters: FloatArray, local_gradient: FloatArray) -> FloatArray:
        """(n_parameters,) the user's vector-Jacobian product."""
        product = self.vector_jacobian(np.array(parameters), np.array(local_gradient))
        gradient = np.array(product, dtype=np.float64)
        _require_shape("vector_jacobian", gradient, (self.parameter_count,), "parameter")
        bad = first_index(~np.isfinite(gradient))
        if bad is not None and np.isfinite(local_gradient).all():
            raise SerdError(
                f"vector_jacobian must return finite numbers, got {gradient[bad]} for parameter"
                f" {bad[0]}; correct the function, or start from other parameters"
            )
        return gradient

    def parameters_of(self, initial: FloatArray) -> FloatArray:
        """The given (n_parameters,) vector: the inverse of the map is not available."""
        vector = np.asarray(initial, dtype=np.float64)
        if vector.shape != (self.parameter_count,):
            raise SerdError(
                f"dynamics of a SparseModel must be its ({self.parameter_count},) parameters, not"
                f" its entries, got shape {vector.shape}"
            )
        return vector

    def _require_table(self, table: FloatArray) -> None:
        if np.shape(table) != self.state.shape:
            raise SerdError(
                f"probabilities must have shape {self.state.shape}, one per entry, got"
                f" {np.shape(table)}; pass them in the order of state and action"
            )


def _require_shape(name: str, given: FloatArray, shape: tuple[int, ...], what: str) -> None:
    """SerdError where a function of the user returns another shape."""
    if given.shape != shape:
        raise SerdError(f"{name} must return {shape} numbers, one per {what}, got {given.shape}")


def known_entries(entries: FloatArray, parameters: FloatArray) -> FloatArray:
    """(E,) entries of a model without parameters."""
    del parameters
    return entries


def no_gradient(parameters: FloatArray, gradient: FloatArray) -> FloatArray:
    """(0,) the vector-Jacobian product of a model without parameters."""
    del parameters, gradient
    return np.zeros(0)


@dataclass(frozen=True, eq=False)
class LogOdds:
    """The map of (E - R,) log odds to the (E,) entries of R rows, each a distribution of its own.

    P(s' | s, a) = exp x(s') / sum of exp x over the row, x of the first entry of each row 0.
    row: (E,) number of the row of each entry, from 0 on and never falling.
    """

    row: IntArray

    @cached_property
    def free(self) -> BoolArray:
        """(E,) entries that are not the first of their row."""
        return np.asarray(np.diff(self.row, prepend=-1) == 0)

    @cached_property
    def _starts(self) -> IntArray:
        return np.flatnonzero(~self.free)

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """(E,) the entries."""
        energies = np.zeros(len(self.row))
        energies[self.free] = parameters
        weights = np.exp(energies - np.maximum.reduceat(energies, self._starts)[self.row])
        return np.asarray(weights / np.add.reduceat(weights, self._starts)[self.row])

    def pull_back(self, parameters: FloatArray, gradient: FloatArray) -> FloatArray:
        """(E - R,) gradient for an (E,) gradient by the entries."""
        probability = self(parameters)
        mean = np.add.reduceat(probability * gradient, self._starts)[self.row]
        return np.asarray((probability * (gradient - mean))[self.free])

    def parameters_of(self, entries: FloatArray) -> FloatArray:
        """(E - R,) log odds of positive (E,) entries."""
        logs = np.log(entries)
        return np.asarray((logs - logs[self._starts][self.row])[self.free])


def learned_transitions(
    n_pairs: tuple[int, int], state: IntArray, action: IntArray, next_state: IntArray
) -> SparseModel:
    """Make unknown transitions over given entries: each pair (s, a) has a distribution of its own.

    n_pairs: (S, A); state, action, next_state: (E,). The parameters are the log odds of each
    transition against the first of its pair.
    """
    nothing = partial(known_entries, np.zeros(0))
    groups = SparseModel(n_pairs, state, action, next_state, 0, nothing, no_gradient).groups
    odds = LogOdds(np.unique(groups.row, return_inverse=True)[1].reshape(-1))
    from_state, by_action = np.divmod(groups.row, n_pairs[1])
    count, following = int(odds.free.sum()), groups.successor
    return SparseModel(n_pairs, from_state, by_action, following, count, odds, odds.pull_back)


def fixed_transitions(
    n_pairs: tuple[int, int],
    state: IntArray,
    action: IntArray,
    next_state: IntArray,
    probability: FloatArray,
) -> SparseModel:
    """Make known transitions from their entries, which must sum to 1 for each pair (s, a).

    n_pairs: (S, A); state, action, next_state, probability: (E,).
    """
    known = float_array("probability", probability, (len(np.atleast_1d(state)),))
    entries = partial(known_entries, known)
    model = SparseModel(n_pairs, state, action, next_state, 0, entries, no_gradient)
    model.require_transitions(known)
    return model
