"""P(s' | s, a) at one set of parameters, ready for products."""

from dataclasses import dataclass
from functools import cached_property

import scipy.sparse

from serd_core.arrays import FloatArray
from serd_core.dynamics.transition_model import TransitionModel


@dataclass(frozen=True, eq=False)
class Transitions:
    """A transition model with its (E,) entries filled in."""

    model: TransitionModel
    entries: FloatArray

    @cached_property
    def matrix(self) -> scipy.sparse.csr_array:
        """(S*A, S) sparse matrix."""
        return self.model.matrix(self.entries)

    @cached_property
    def _transposed(self) -> scipy.sparse.csc_array:
        return self.matrix.T

    def expected(self, values: FloatArray) -> FloatArray:
        """(S, A) expectation sum_s' P(s'|s,a) values(s'); 0 where an action is unavailable."""
        expected: FloatArray = self.matrix @ values
        return expected.reshape(self.model.available.shape)

    def flow(self, weights: FloatArray) -> FloatArray:
        """(S,) transposed product sum_{s,a} P(s'|s,a) weights(s,a)."""
        flow: FloatArray = self._transposed @ weights.ravel()
        return flow


def transitions_at(model: TransitionModel, parameters: FloatArray) -> Transitions:
    """The model's transitions at (n_parameters,) parameters."""
    return Transitions(model, model.entries(model.local_probabilities(parameters)))


def transitions_of(model: TransitionModel, local_probabilities: FloatArray) -> Transitions:
    """The transitions of given local probabilities; SerdError where a row is no distribution."""
    entries = model.entries(local_probabilities)
    model.require_stochastic(entries)
    return Transitions(model, entries)
