"""Sums over the entries of P, compiled by numba, without P as a matrix or a list of entries.

Entry k < length[s, a] of row (s, a) has the successor successor[first[s, a] + k] and the
probability number place[s, a] + k of a flat list. Outcome models share both: their successors are
kept once per state where actions lead to the same ones, and the list is the table of outcomes.
All indices have four bytes, so that each function is compiled for one set of types.
"""

from functools import cached_property
from typing import Any

import numba
import numpy as np

from serd_core.arrays import FloatArray, IntArray, once_per_state
from serd_core.bellman.bellman_solver import BellmanProblem
from serd_core.bellman.compiled.swept_bicgstab import Swept
from serd_core.bellman.engine import Engine
from serd_core.bellman.equations import SoftBellman, boltzmann
from serd_core.bellman.linear.automatic import Automatic
from serd_core.bellman.linear.krylov import Krylov
from serd_core.bellman.linear.linear_solver import LinearSolver, LinearSystem
from serd_core.bellman.linear.policy_pattern import PolicyPattern
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import TransitionModel, Transitions
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp

#: exp() of less adds nothing to a sum of at least 1.
LEAST_EXPONENT = -50.0
#: Most sweeps that `settled` does.
MOST_SWEEPS = 30

_compiled: Any = numba.njit(cache=True, nogil=True, fastmath={"contract"})


class CompiledEngine(Engine):
    """The entries of a transition model, row by row."""

    sweeps = True

    def __init__(self, model: TransitionModel) -> None:
        super().__init__(model)
        n_states, n_actions = model.available.shape
        if isinstance(model, OutcomeModels):
            table, size = once_per_state(model.successors), model.n_outcomes
            first: IntArray = np.arange(0, table.size, size).reshape(table.shape[:2])
            successor, place = table.reshape(-1), model.model_of * size
        else:
            successor = model.successor
            first = place = model.row_start[:-1].reshape(n_states, n_actions)
        self._rows: Any = (
            np.array(successor, dtype=np.int32),
            *(
                np.array(np.broadcast_to(each, model.available.shape), dtype=np.int32, order="C")
                for each in (first, place, model.row_length)
            ),
        )

    @cached_property
    def pattern(self) -> PolicyPattern:
        """Places of the non-zeros of I - gamma P_pi."""
        return self._structure[0]

    def q(self, problem: BellmanProblem, value: FloatArray) -> FloatArray:
        """(S, A) R + gamma P V."""
        q = np.empty(self.model.available.shape)
        _back_up(*self._rows, *self._numbers(problem), _plain(value), self._near, q)
        return q

    def backup(
        self, problem: BellmanProblem, value: FloatArray
    ) -> tuple[FloatArray, FloatArray | None]:
        """(S,) T V; of the soft equation without a table of Q."""
        if not problem.equation.curved:
            return super().backup(problem, value)
        target = np.empty(self.model.n_states)
        given = self._numbers(problem)
        _back_up_softly(*self._rows, *given, _plain(value), self._near, target)
        return target, None

    def settled(self, problem: BellmanProblem, value: FloatArray, smallest: float) -> FloatArray:
        """(S,) value after sweeps, of which all but the first skip states that are settled."""
        settled, given = np.array(value), self._numbers(problem)
        _settle(*self._rows, *given, settled, self._near, MOST_SWEEPS, float(smallest))
        return settled

    def flow(self, transitions: Transitions, weights: FloatArray) -> FloatArray:
        """(S,) transposed product."""
        flow = np.zeros(self.model.n_states)
        _add_flow(*self._rows, self._probabilities(transitions), _plain(weights), flow)
        return flow

    def local_gradient(
        self, transitions: Transitions, weights: FloatArray, values: FloatArray
    ) -> FloatArray:
        """Gradient by the local probabilities."""
        sums = np.zeros(len(self._probabilities(transitions)))
        _sum_by_probability(*self._rows, _plain(weights), _plain(values), sums)
        if isinstance(self.model, OutcomeModels):
            return sums.reshape(transitions.local_probabilities.shape)
        return self.model.gather(sums)

    def system(
        self,
        transitions: Transitions,
        policy: FloatArray,
        discount: float,
        solver: LinearSolver,
    ) -> LinearSystem:
        """The matrix; BiCGSTAB with sweeps takes the place of that without, which may follow it."""
        pattern, slot = self._structure
        data = np.zeros(len(pattern.column))
        given = self._probabilities(transitions), _plain(policy), float(discount)
        structure = pattern.row_start, pattern.diagonal
        _fill_system(slot, *self._rows[1:], *given, *structure, data)
        chosen = solver.chosen(pattern, data) if isinstance(solver, Automatic) else solver
        if isinstance(chosen, Krylov) and chosen.fill <= 0:
            return Swept(chosen, solver).prepare(pattern, data)
        return chosen.prepare(pattern, data)

    def _numbers(self, problem: BellmanProblem) -> tuple[FloatArray, FloatArray, float]:
        """Probabilities, rewards and discount, as compiled functions take them."""
        probabilities = self._probabilities(problem.transitions)
        return probabilities, _plain(problem.rewards), float(problem.discount)

    def _probabilities(self, transitions: Transitions) -> FloatArray:
        """The list of probabilities that `place` refers to."""
        local = transitions.local_probabilities
        listed = isinstance(self.model, OutcomeModels)
        return _plain(np.ravel(local) if listed else self.model.entries(local))

    @property
    def _near(self) -> FloatArray:
        """Work space for values at the successors of a row."""
        return np.empty(self.model.longest_row)

    @cached_property
    def _structure(self) -> tuple[PolicyPattern, IntArray]:
        """Places of the non-zeros of I - gamma P_pi, and of each successor in its row of these."""
        n_states, (successor, first, _, length) = self.model.n_states, self._rows
        row_start: Any = np.zeros(n_states + 1, dtype=np.int32)
        seen_by: Any = np.full(n_states, -1, dtype=np.int32)
        _count_successors(successor, first, length, seen_by, row_start)
        row_start = np.cumsum(row_start, dtype=np.int32)
        column: Any = np.empty(int(row_start[-1]), dtype=np.int32)
        slot: Any = np.empty(len(successor), dtype=np.int32)
        diagonal: Any = np.empty(n_states, dtype=np.int32)
        seen_by[:] = -1
        _find_places(successor, first, length, row_start, seen_by, column, slot, diagonal)
        return PolicyPattern(diagonal, row_start, column), slot


def rehearse() -> None:
    """Do everything once for four states; SerdError where that differs from what SciPy does."""
    ring = np.arange(4)[:, None, None] + np.array([[0, 1], [0, 3]])
    model = OutcomeModels(ring % 4, np.tile([0, 1], (4, 1)), np.ones((4, 2), np.bool_), 2)
    transitions = Transitions(model, np.array([[0.25, 0.75], [0.5, 0.5]]))
    table, value = np.arange(8.0).reshape(4, 2) / 8.0, np.ones(4)
    problem = BellmanProblem(SoftBellman(), table, transitions, Mdp(model, 0.5))
    results = []
    for engine in (Engine(model), CompiledEngine(model)):
        target, _ = engine.backup(problem, value)
        gradient = engine.local_gradient(transitions, table, value)
        parts = [engine.q(problem, value).ravel(), target, gradient.ravel()]
        parts.append(engine.flow(transitions, table))
        for quick_from in (0, 5):
            swept = Swept(Krylov(), Krylov(), quick_from)
            solver = swept if engine.sweeps else Krylov()
            system = engine.system(transitions, boltzmann(table, 1.0), 0.5, solver)
            parts += [system.solve(value), system.solve(value, transposed=True)]
        for _ in range(60):
            target, _ = engine.backup(problem, engine.settled(problem, target, 0.0))
        results.append(np.concatenate([*parts, target]))
    if not np.allclose(results[0], results[1], rtol=1e-9, atol=1e-9):
        raise SerdError(
            "compiled code must give the numbers of SciPy, but does not on this machine"
        )


def _plain(numbers: FloatArray) -> FloatArray:
    """The numbers one after the other in an array that may be written to, copied if need be."""
    return np.require(numbers, np.float64, ["C", "W"])


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
def _settle(  # type: ignore[no-untyped-def]
    successor, first, place, length, p, rewards, discount, values, near, most, smallest
):
    """Gauss-Seidel sweeps; a rise counts the visits to come of the state itself (one Newton step).

    Both keep T V >= V where it holds, and shrink the largest error where it does not.
    """
    n_states, n_actions = rewards.shape
    q = np.empty(n_actions)
    due = np.ones(n_states, dtype=np.bool_)
    for sweep in range(most):
        visits = 0
        for i in range(n_states):
            s = n_states - 1 - i if sweep % 2 else i
            if sweep > 0 and not due[s]:
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
            if abs(move) > smallest:
                for a in range(n_actions):
                    for k in range(length[s, a]):
                        due[successor[first[s, a] + k]] = True
        if visits == 0:
            break


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
