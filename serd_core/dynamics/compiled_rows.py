"""Sums over the entries of P, compiled by numba, without P as a matrix.

Entry e of row r = (s, a) has the probability p[local_index[e]] and the successor s'[e]. No array of
entries is built, indices are the smallest that fit, and each sum reads them once.
"""

from typing import Any

import numba
import numpy as np

from serd_core.arrays import FloatArray, IntArray

_compiled: Any = numba.njit(cache=True, nogil=True, fastmath={"contract"})


class CompiledRows:
    """The entries of a transition model, row by row."""

    def __init__(self, row_start: IntArray, successor: IntArray, local_index: IntArray) -> None:
        largest = int(local_index.max(initial=0))
        self._rows = (
            row_start,
            successor.astype(np.int32),
            local_index.astype(np.min_scalar_type(largest)),
        )

    def backed_up(
        self, probabilities: FloatArray, rewards: FloatArray, discount: float, values: FloatArray
    ) -> FloatArray:
        """(S, A) R + discount * P V."""
        q = np.empty_like(rewards)
        _back_up(*self._rows, probabilities, rewards.ravel(), discount, values, q.ravel())
        return q

    def flow(self, probabilities: FloatArray, weights: FloatArray, n_states: int) -> FloatArray:
        """(S,) sum_{s,a} P(s' | s, a) weights(s, a)."""
        row_start, successor, local_index = self._rows
        flow = np.zeros(n_states)
        _sum_by_position(row_start, successor, local_index, probabilities, weights.ravel(), flow)
        return flow

    def system_data(
        self, probabilities: FloatArray, policy: FloatArray, position: IntArray, size: int
    ) -> FloatArray:
        """(size,) sum of policy(s, a) P(s' | s, a) over the entries that share a position."""
        data = np.zeros(size)
        row_start, _, local_index = self._rows
        _sum_by_position(row_start, position, local_index, probabilities, policy.ravel(), data)
        return data

    def local_gradient(self, size: int, weights: FloatArray, values: FloatArray) -> FloatArray:
        """(size,) sum of weights(s, a) values(s') over the entries that share a probability."""
        sums = np.zeros(size)
        _sum_by_probability(*self._rows, weights.ravel(), values, sums)
        return sums


def largest_and_sums(q: FloatArray, temperature: float) -> tuple[FloatArray, FloatArray]:
    """(S,) max_a Q and sum_a exp((Q - max Q) / temperature)."""
    largest, sums = np.empty(len(q)), np.empty(len(q))
    _reduce_rows(q, temperature, largest, sums)
    return largest, sums


def boltzmann_rows(q: FloatArray, temperature: float) -> FloatArray:
    """(S, A) probabilities proportional to exp(Q / temperature)."""
    policy = np.empty_like(q)
    _normalise_rows(q, temperature, policy)
    return policy


@_compiled
def _back_up(row_start, successor, local_index, p, rewards, discount, values, q):  # type: ignore[no-untyped-def]
    for row in range(len(q)):
        expected = 0.0
        for entry in range(row_start[row], row_start[row + 1]):
            expected += p[local_index[entry]] * values[successor[entry]]
        q[row] = rewards[row] + discount * expected


@_compiled
def _sum_by_position(row_start, position, local_index, p, policy, sums):  # type: ignore[no-untyped-def]
    for row in range(len(policy)):
        for entry in range(row_start[row], row_start[row + 1]):
            sums[position[entry]] += policy[row] * p[local_index[entry]]


@_compiled
def _sum_by_probability(row_start, successor, local_index, weights, values, sums):  # type: ignore[no-untyped-def]
    for row in range(len(weights)):
        for entry in range(row_start[row], row_start[row + 1]):
            sums[local_index[entry]] += weights[row] * values[successor[entry]]


@_compiled
def _reduce_rows(q, temperature, largest, sums):  # type: ignore[no-untyped-def]
    for state in range(len(q)):
        highest = -np.inf
        for action in range(q.shape[1]):
            highest = max(highest, q[state, action])
        total = 0.0
        for action in range(q.shape[1]):
            total += np.exp((q[state, action] - highest) / temperature)
        largest[state], sums[state] = highest, total


@_compiled
def _normalise_rows(q, temperature, policy):  # type: ignore[no-untyped-def]
    for state in range(len(q)):
        highest = -np.inf
        for action in range(q.shape[1]):
            highest = max(highest, q[state, action])
        total = 0.0
        for action in range(q.shape[1]):
            policy[state, action] = np.exp((q[state, action] - highest) / temperature)
            total += policy[state, action]
        for action in range(q.shape[1]):
            policy[state, action] /= total
