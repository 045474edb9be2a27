"""How well two-way traffic sorts itself into lanes (Rex & Löwen, Physical Review E 75, 2007).

For each person, phi_i = ((n_same - n_opposite) / (n_same + n_opposite))^2 over the people in the
same strip along the way; the order is the mean of phi_i: 1 for perfect lanes.
"""

import numpy as np

from serd_core.arrays import FloatArray


def lane_order(across_m: FloatArray, along_mps: FloatArray, strip_m: float = 0.4) -> float:
    """Order of people at (N,) positions across the way, walking at (N,) speeds along it."""
    same_strip = np.abs(across_m[:, None] - across_m[None, :]) < strip_m
    agreement = np.sign(along_mps)[:, None] * np.sign(along_mps)[None, :]
    share = np.sum(same_strip * agreement, axis=1) / np.sum(same_strip, axis=1)
    return float(np.mean(share**2))


def shuffled_lane_order(
    across_m: FloatArray,
    along_mps: FloatArray,
    rng: np.random.Generator,
    strip_m: float = 0.4,
    n_shuffles: int = 100,
) -> float:
    """Mean order of the same people with their directions dealt out at random: the baseline."""
    orders = [lane_order(across_m, rng.permutation(along_mps), strip_m) for _ in range(n_shuffles)]
    return float(np.mean(orders))
