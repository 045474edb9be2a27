"""Second derivatives of functions of the transition probabilities, sum_g h_g(P_g).

g = (s, a, s') runs over distinct transitions:

    d2 sum h(P) = sum h'(P) d2 P + sum h''(P) dP dP^T

For h = c log P, the log-likelihood of counts c, h' = c / P and h'' = -c / P^2.
"""

import numpy as np
import scipy.sparse

from serd_core.arrays import BoolArray, FloatArray, floored
from serd_core.dynamics.transition_model import TransitionModel


def log_transition_hessian(
    model: TransitionModel, theta: FloatArray, counts: FloatArray
) -> FloatArray:
    """(N, N) of sum c_g log P_g for (G,) counts of the model's distinct transitions."""
    local = model.local_probabilities(theta)
    present = floored(model.groups.probabilities(model.entries(local)))
    ratio = counts / present
    return transition_hessian(model, theta, ratio, -ratio / present)


def transition_hessian(
    model: TransitionModel, theta: FloatArray, first: FloatArray, second: FloatArray
) -> FloatArray:
    """(N, N) of sum h_g(P_g) for (G,) first and second derivatives of h."""
    by_local = model.gather(first[model.groups.group_of_entry])
    bent = second != 0
    slopes = transition_jacobian(model, model.local_jacobian(theta), bent)
    bend = (slopes * second[bent][:, None]).T @ slopes
    return np.asarray(model.local_curvature(theta, by_local) + bend)


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
