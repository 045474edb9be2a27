"""Derivatives of V and Q by all parameters at once, from one S x S factorisation.

    (I - gamma P_pi) dV = sum_a pi (f + gamma dP V),   dQ = f + gamma dP V + gamma P dV

This is the thesis's Q-gradient (4.21) reduced to states: N right-hand sides of one LU.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from serd_core.arrays import FloatArray
from serd_core.bellman.solution import BellmanSolution
from serd_core.dynamics.transitions import Transitions
from serd_core.linear.linear_solver import LinearSystem


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """by_value: (S, n); by_q: (S, A, n), zero where an action is unavailable."""

    by_value: FloatArray
    by_q: FloatArray


def sensitivities(
    features: FloatArray,
    discount: float,
    transitions: Transitions,
    solution: BellmanSolution,
    local_jacobian: FloatArray,
    system: LinearSystem,
) -> Sensitivities:
    """Derivatives by reward weights, then dynamics parameters."""
    model = transitions.model
    rows = model.available.size
    weighted = scipy.sparse.csr_array(
        (discount * solution.value[model.successor], (model.row, model.local_index)),
        shape=(rows, len(local_jacobian)),
    )
    by_dynamics = (weighted @ local_jacobian).reshape(*model.available.shape, -1)
    usable = np.where(model.available[:, :, None], features, 0.0)
    immediate = np.concatenate([usable, by_dynamics], axis=2)
    by_value = system.solve(np.einsum("sa,san->sn", solution.policy, immediate))
    onward = (transitions.matrix @ by_value).reshape(immediate.shape)
    return Sensitivities(by_value=by_value, by_q=immediate + discount * onward)
