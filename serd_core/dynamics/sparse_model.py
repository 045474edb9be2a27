"""A general sparse P(s' | s, a), entry by entry.

Known transitions have no parameters. Those to be learned give each pair (s, a) a distribution of
its own, whose parameters are the log odds of each entry against the first of its pair:

    P(s' | s, a) = exp x(s') / sum of exp x over the row, x of the first entry of each row 0.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from serd_core.arrays import (
    BYTES_PER_PAIR,
    BoolArray,
    FloatArray,
    IntArray,
    float_array,
    int_array,
    require_index,
    require_memory,
)
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError


@dataclass(frozen=True, eq=False)
class SparseModel(TransitionModel):
    """Transitions given entry by entry, known or to be learned.

    n_pairs: (S, A); state, action, next_state: (E,) of each entry, in any order where known, and
    distinct and sorted where learned. known: (E,) their probabilities, None for those to be
    learned. Pairs without entries are not available.
    """

    n_pairs: tuple[int, int]
    state: IntArray
    action: IntArray
    next_state: IntArray
    known: FloatArray | None = None

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
        sizes = {"state": pairs[0], "action": pairs[1], "next_state": pairs[0]}
        for name, size in sizes.items():
            column = int_array(name, getattr(self, name), (n_entries,))
            require_index(name, column, size, f"a {name.replace('_', ' ')}")
            object.__setattr__(self, name, column)

    @cached_property
    def _row(self) -> IntArray:
        """(E,) pair of each entry, in the order given."""
        return np.asarray(self.state * self.n_pairs[1] + self.action)

    @cached_property
    def _free(self) -> BoolArray:
        """(E,) entries that have a parameter: all but the first of their pair."""
        if self.known is not None:
            return np.zeros(len(self.state), dtype=np.bool_)
        return np.asarray(np.diff(self._row, prepend=-1) == 0)

    @cached_property
    def _place(self) -> IntArray:
        """(E,) number of each entry's pair among those that have entries, of sorted entries."""
        return np.cumsum(~self._free) - 1

    def _by_pair(self, sums: np.ufunc, numbers: FloatArray) -> FloatArray:
        """(E,) sums, or the like, of (E,) numbers over the entries of the same pair."""
        return np.asarray(sums.reduceat(numbers, np.flatnonzero(~self._free))[self._place])

    @property
    def n_parameters(self) -> int:
        return int(self._free.sum())

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

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return tuple(f"parameter {i}" for i in range(self.n_parameters))

    def local_probabilities(self, parameters: FloatArray) -> FloatArray:
        """(E,) probabilities, in the order given."""
        if self.known is not None:
            return self.known
        energies = np.zeros(len(self.state))
        energies[self._free] = parameters
        weights = np.exp(energies - self._by_pair(np.maximum, energies))
        return np.asarray(weights / self._by_pair(np.add, weights))

    def pull_back(self, parameters: FloatArray, local_gradient: FloatArray) -> FloatArray:
        if self.known is not None:
            return np.zeros(0)
        probability = self.local_probabilities(parameters)
        mean = self._by_pair(np.add, probability * local_gradient)
        return np.asarray((probability * (local_gradient - mean))[self._free])

    def parameters_of(self, initial: FloatArray) -> FloatArray:
        """The given (n_parameters,) log odds."""
        vector = np.asarray(initial, dtype=np.float64)
        if vector.shape != (self.n_parameters,):
            raise SerdError(
                f"dynamics of a SparseModel must be its ({self.n_parameters},) parameters, not"
                f" its entries, got shape {vector.shape}"
            )
        return vector

    def log_odds(self, entries: FloatArray) -> FloatArray:
        """(n_parameters,) of positive (E,) entries."""
        logs = np.log(entries)
        first = logs[np.flatnonzero(~self._free)]
        return np.asarray((logs - first[self._place])[self._free])

    def _require_table(self, table: FloatArray) -> None:
        if np.shape(table) != self.state.shape:
            raise SerdError(
                f"probabilities must have shape {self.state.shape}, one per entry, got"
                f" {np.shape(table)}; pass them in the order of state and action"
            )


def learned_transitions(
    n_pairs: tuple[int, int], state: IntArray, action: IntArray, next_state: IntArray
) -> SparseModel:
    """Make unknown transitions over given entries: each pair (s, a) has a distribution of its own.

    n_pairs: (S, A); state, action, next_state: (E,). The parameters are the log odds of each
    transition against the first of its pair.
    """
    groups = SparseModel(n_pairs, state, action, next_state, np.zeros(0)).groups
    from_state, by_action = np.divmod(groups.row, n_pairs[1])
    return SparseModel(n_pairs, from_state, by_action, groups.successor)


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
    model = SparseModel(n_pairs, state, action, next_state, known)
    model.require_transitions(known)
    return model
