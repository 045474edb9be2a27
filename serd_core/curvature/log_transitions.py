"""Second derivatives of sum_g c_g log P_g over distinct transitions g = (s, a, s').

d2 log P = d2 P / P - dP dP^T / P^2
"""

import numpy as np
import scipy.sparse

from serd_core.arrays import BoolArray, FloatArray, floored
from serd_core.dynamics.transition_model import TransitionModel


def log_transition_hessian(
    model: TransitionModel, theta: FloatArray, counts: FloatArray
) -> FloatArray:
    """(N, N) for (G,) counts of the model's distinct transitions."""
    local = model.local_probabilities(theta)
    present = floored(model.groups.probabilities(model.entries(local)))
    ratio = counts / present
    by_local = model.gather(ratio[model.groups.group_of_entry])
    slopes = transition_jacobian(model, model.local_jacobian(theta), counts > 0)
    weights = (ratio / present)[counts > 0]
    bend = (slopes * weights[:, None]).T @ slopes
    return np.asarray(model.local_curvature(theta, by_local) - bend)


def transition_jacobian(
    model: TransitionModel, local_jacobian: FloatArray, wanted: BoolArray
) -> FloatArray:
    """(n_wanted, N) derivative of the wanted transitions (mask over G) by the parameters."""
    n_groups, n_local = len(model.groups), len(local_jacobian)
    ones = np.ones(len(model.local_index))
    choose = scipy.sparse.csr_array(
        (ones, (model.groups.group_of_entry, model.local_index)), shape=(n_groups, n_local)
    )
    return np.asarray(choose[np.flatnonzero(wanted)] @ local_jacobian)
