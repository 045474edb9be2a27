"""Checks of probability tables that callers hand over: policies and distributions over states."""

import numpy as np

from serd_core.arrays import FloatArray, first_index, float_array
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp

#: How far a sum may be from 1; tables read from files are rounded.
SUM_TOLERANCE = 1e-6


def checked_policy(name: str, values: FloatArray, mdp: Mdp) -> FloatArray:
    """(S, A) copy of a policy; SerdError naming the first state whose row is no distribution."""
    policy = float_array(name, values, mdp.available.shape)
    bad = first_index((policy < -1e-9) | (~mdp.available & (policy != 0.0)))
    if bad is not None:
        raise SerdError(
            f"{name}[{bad[0]}, {bad[1]}] must be a probability of an available action,"
            f" got {policy[bad]}; use 0 for actions that are not available"
        )
    _require_rows_of_one(name, policy)
    return policy


def checked_choices(
    name: str, values: FloatArray, shape: tuple[int | None, int | None]
) -> FloatArray:
    """(S, A) copy of a policy of whatever problem; SerdError where a row is no distribution."""
    policy = float_array(name, values, shape)
    negative = first_index(policy < -1e-9)
    if negative is not None:
        raise SerdError(
            f"{name}{list(negative)} must be a probability, got {policy[negative]}"
            "; use 0 for actions that are not available"
        )
    _require_rows_of_one(name, policy)
    return np.maximum(policy, 0.0)


def _require_rows_of_one(name: str, policy: FloatArray) -> None:
    sums = policy.sum(axis=1)
    off = first_index(np.abs(sums - 1.0) > SUM_TOLERANCE)
    if off is not None:
        raise SerdError(f"{name}[{off[0]}] must sum to 1, got {sums[off]}; normalise over actions")


def checked_distribution(name: str, values: FloatArray, size: int) -> FloatArray:
    """(size,) copy of a distribution; SerdError where it is none."""
    share = float_array(name, values, (size,))
    negative = first_index(share < 0)
    if negative is not None:
        raise SerdError(
            f"{name}[{negative[0]}] must not be negative, got {share[negative]}; use 0 for never"
        )
    if abs(float(share.sum()) - 1.0) > SUM_TOLERANCE:
        raise SerdError(f"{name} must sum to 1, got a sum of {share.sum()}; normalise it")
    return share
