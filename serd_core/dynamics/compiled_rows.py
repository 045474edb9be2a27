"""Sums over the entries of P, compiled by numba, without P as a matrix or a list of entries.

Entry k of row (s, a) is found by `RowBlocks`: its successor in a table that actions may share, its
probability in a list that states may share. The arrays have the smallest indices that fit.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

from serd_core.arrays import FloatArray, IntArray, index_type, matrix_index_type
from serd_core.bellman.linear.policy_pattern import PolicyPattern
from serd_core.compiled import halves, side_by_side
from serd_core.dynamics.transition_model import RowBlocks, Sweeps

#: Probabilities of P, (S, A) rewards and the discount.
Given = tuple[FloatArray, FloatArray, float]
#: exp() of less adds nothing to a sum of at least 1.
LEAST_EXPONENT = -50.0

_compiled: Any = numba.njit(cache=True, nogil=True, fastmath={"contract"})


class CompiledRows:
    """The entries of a transition model, row by row."""

    def __init__(self, blocks: RowBlocks) -> None:
        self._rows = (blocks.successor, blocks.first, blocks.place, blocks.length)
        self._longest = int(blocks.length.max())

    @property
    def _near(self) -> FloatArray:
        """Work space for values at the successors of a row."""
        return np.empty(self._longest)

    def _in_parts(self, work: Callable[[tuple[int, int]], None]) -> None:
        """Do work on the states of each part, which changes no sum."""
        with side_by_side(halves(len(self._rows[1]))) as in_parts:
            in_parts(work)

    def backed_up(self, given: Given, values: FloatArray) -> FloatArray:
        """(S, A) R + discount * P V."""
        return self._filled(np.empty(given[1].shape), _back_up, given, values)

    def soft_maximum(self, given: Given, values: FloatArray) -> FloatArray:
        """(S,) log sum_a exp(R + discount * P V), without a table of the summands."""
        return self._filled(np.empty(len(given[1])), _back_up_softly, given, values)

    def _filled(
        self, target: FloatArray, back_up: Callable[..., None], given: Given, values: FloatArray
    ) -> FloatArray:
        """The target after `back_up` of all states."""

        def work(part: tuple[int, int]) -> None:
            low, high = part
            back_up(*self._of_states(low, high, given, values), target[low:high])

        self._in_parts(work)
        return target

    def _of_states(self, low: int, high: int, given: Given, values: FloatArray) -> tuple[Any, ...]:
        """What compiled functions take of the states low to high - 1."""
        successor, *tables = self._rows
        probabilities, rewards, discount = given
        numbers = probabilities, rewards[low:high], discount, values, self._near
        return successor, *(table[low:high] for table in tables), *numbers

    def settle(self, given: Given, values: FloatArray, sweeps: Sweeps) -> FloatArray:
        """(S,) values after sweeps of the soft equation."""
        settled = values.copy()
        _settle(*self._rows, *given, settled, self._near, sweeps)
        return settled

    def flow(self, probabilities: FloatArray, weights: FloatArray, n_states: int) -> FloatArray:
        """(S,) sum_{s,a} P(s' | s, a) weights(s, a)."""
        flow = np.zeros(n_states)
        _add_flow(*self._rows, probabilities, weights, flow)
        return flow

    def local_gradient(self, size: int, weights: FloatArray, values: FloatArray) -> FloatArray:
        """(size,) sum of weights(s, a) values(s') over the entries that share a probability."""
        sums = np.zeros(size)
        _sum_by_probability(*self._rows, weights, values, sums)
        return sums

    def soft_system_data(
        self, pattern: PolicyPattern, given: Given, values: FloatArray
    ) -> FloatArray:
        """(nnz,) numbers of I - discount * P_pi for the soft policy of V, without a table of it."""
        assert isinstance(pattern, SlottedPattern)
        data = np.zeros(len(pattern.column))

        def work(part: tuple[int, int]) -> None:
            low, high = part
            structure = pattern.slot, pattern.row_start[low:high], pattern.diagonal[low:high]
            _fill_system_softly(*self._of_states(low, high, given, values), *structure, data)

        self._in_parts(work)
        return data

    def policy_pattern(self) -> "SlottedPattern":
        """Structure of I - gamma P_pi."""
        n_states = len(self._rows[1])
        row_start = np.zeros(n_states + 1, dtype=np.int64)
        successor, first, _, length = self._rows
        _count_successors(
            successor, first, length, np.full(n_states, -1, dtype=np.int32), row_start
        )
        longest = int(row_start.max())
        row_start = np.cumsum(row_start)
        row_start = row_start.astype(matrix_index_type(int(row_start[-1])))
        column: Any = np.empty(int(row_start[-1]), dtype=np.int32)
        slot = np.empty(len(self._rows[0]), dtype=index_type(longest))
        diagonal = np.empty(n_states, dtype=row_start.dtype)
        place = np.full(n_states, -1, dtype=np.int32)
        _find_places(successor, first, length, row_start, place, column, slot, diagonal)
        return SlottedPattern(diagonal, row_start, column, slot, self._rows[1:])


@dataclass(frozen=True, eq=False)
class SlottedPattern(PolicyPattern):
    """The pattern with the place of each successor of `RowBlocks` in its row of the matrix.

    rows: first, place and length of `RowBlocks`.
    """

    slot: IntArray
    rows: tuple[IntArray, IntArray, IntArray]

    def system_data(
        self, policy: FloatArray, probabilities: FloatArray, discount: float
    ) -> FloatArray:
        """(nnz,) numbers of I - gamma P_pi for an (S, A) policy and the flat probabilities."""
        data = np.zeros(len(self.column))
        structure = self.row_start, self.diagonal
        _fill_system(self.slot, *self.rows, probabilities, policy, discount, *structure, data)
        return data


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
def _back_up_state(s, successor, first, place, length, p, rewards, discount, values, near, q):  # type: ignore[no-untyped-def]
    """q <- (A,) R + discount * P V of state s; returns the largest.

    near: work space for V at the successors of an action, which the next one often shares.
    """
    highest, start, known = -np.inf, -1, 0
    for a in range(len(q)):
        n_entries = length[s, a]
        if first[s, a] != start or n_entries > known:
            start, known = first[s, a], n_entries
            for k in range(known):
                near[k] = values[successor[start + k]]
        ahead = 0.0
        for k in range(n_entries):
            ahead += p[place[s, a] + k] * near[k]
        q[a] = rewards[s, a] + discount * ahead
        highest = max(highest, q[a])
    return highest


@_compiled
def _weigh(q, highest):  # type: ignore[no-untyped-def]
    """q <- exp(q - highest), without those that rounding of their sum hides; returns the sum."""
    total = 0.0
    for a in range(len(q)):
        below = q[a] - highest
        q[a] = 1.0 if below == 0.0 else 0.0 if below < LEAST_EXPONENT else np.exp(below)
        total += q[a]
    return total


@_compiled
def _back_up(successor, first, place, length, p, rewards, discount, values, near, q):  # type: ignore[no-untyped-def]
    for s in range(len(q)):
        _back_up_state(s, successor, first, place, length, p, rewards, discount, values, near, q[s])


@_compiled
def _back_up_softly(  # type: ignore[no-untyped-def]
    successor, first, place, length, p, rewards, discount, values, near, target
):
    q = np.empty(rewards.shape[1])
    for s in range(len(target)):
        highest = _back_up_state(
            s, successor, first, place, length, p, rewards, discount, values, near, q
        )
        target[s] = highest + np.log(_weigh(q, highest))


@_compiled
def _settle(successor, first, place, length, p, rewards, discount, values, near, sweeps):  # type: ignore[no-untyped-def]
    """Gauss-Seidel sweeps; a rise counts the visits to come of the state itself (one Newton step).

    Both keep T V >= V where it holds, and shrink the largest error where it does not.
    """
    n_states, n_actions = rewards.shape
    q = np.empty(n_actions)
    due = np.ones(n_states, dtype=np.bool_)
    for sweep in range(sweeps.most):
        visits = 0
        for i in range(n_states):
            s = n_states - 1 - i if sweep % 2 else i
            if sweep >= sweeps.whole and not due[s]:
                continue
            due[s] = False
            visits += 1
            highest = _back_up_state(
                s, successor, first, place, length, p, rewards, discount, values, near, q
            )
            total, staying = _weigh(q, highest), 0.0
            for a in range(n_actions):
                for k in range(length[s, a]):
                    if successor[first[s, a] + k] == s:
                        staying += q[a] * p[place[s, a] + k]
            move = highest + np.log(total) - values[s]
            if move > 0.0:
                move /= 1.0 - discount * min(staying / total, 1.0)
            values[s] += move
            if abs(move) > sweeps.smallest:
                for a in range(n_actions):
                    for k in range(length[s, a]):
                        due[successor[first[s, a] + k]] = True
        if visits == 0:
            break


@_compiled
def _fill_system_softly(  # type: ignore[no-untyped-def]
    successor,
    first,
    place,
    length,
    p,
    rewards,
    discount,
    values,
    near,
    slot,
    row_start,
    diagonal,
    data,
):
    policy = np.empty(rewards.shape[1])
    for s in range(len(diagonal)):
        highest = _back_up_state(
            s, successor, first, place, length, p, rewards, discount, values, near, policy
        )
        total = _weigh(policy, highest)
        start = row_start[s]
        for a in range(len(policy)):
            weight = -discount * policy[a] / total
            for k in range(length[s, a]):
                data[start + slot[first[s, a] + k]] += weight * p[place[s, a] + k]
        data[diagonal[s]] += 1.0


@_compiled
def _add_flow(successor, first, place, length, p, weights, flow):  # type: ignore[no-untyped-def]
    for s in range(weights.shape[0]):
        for a in range(weights.shape[1]):
            for k in range(length[s, a]):
                flow[successor[first[s, a] + k]] += weights[s, a] * p[place[s, a] + k]


@_compiled
def _sum_by_probability(successor, first, place, length, weights, values, sums):  # type: ignore[no-untyped-def]
    for s in range(weights.shape[0]):
        for a in range(weights.shape[1]):
            for k in range(length[s, a]):
                sums[place[s, a] + k] += weights[s, a] * values[successor[first[s, a] + k]]


@_compiled
def _fill_system(slot, first, place, length, p, policy, discount, row_start, diagonal, data):  # type: ignore[no-untyped-def]
    for s in range(policy.shape[0]):
        start = row_start[s]
        for a in range(policy.shape[1]):
            weight = -discount * policy[s, a]
            for k in range(length[s, a]):
                data[start + slot[first[s, a] + k]] += weight * p[place[s, a] + k]
        data[diagonal[s]] += 1.0


@_compiled
def _count_successors(successor, first, length, seen_by, count):  # type: ignore[no-untyped-def]
    """count[s + 1] <- number of distinct states among s and its successors."""
    for s in range(first.shape[0]):
        seen_by[s] = s
        count[s + 1] = 1
        for a in range(first.shape[1]):
            for k in range(length[s, a]):
                following = successor[first[s, a] + k]
                if seen_by[following] != s:
                    seen_by[following] = s
                    count[s + 1] += 1


@_compiled
def _find_places(successor, first, length, row_start, place_of, column, slot, diagonal):  # type: ignore[no-untyped-def]
    """Sorted successors of each state, and the place of each in its row."""
    for s in range(first.shape[0]):
        start, end = row_start[s], row_start[s]
        column[end] = s
        place_of[s] = 0
        end += 1
        for a in range(first.shape[1]):
            for k in range(length[s, a]):
                following = successor[first[s, a] + k]
                if place_of[following] < 0:
                    place_of[following] = 0
                    column[end] = following
                    end += 1
        column[start:end].sort()
        for j in range(start, end):
            place_of[column[j]] = j - start
        diagonal[s] = start + place_of[s]
        for a in range(first.shape[1]):
            for k in range(length[s, a]):
                slot[first[s, a] + k] = place_of[successor[first[s, a] + k]]
        for j in range(start, end):
            place_of[column[j]] = -1


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
