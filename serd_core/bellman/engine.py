"""Work on the transitions of an MDP: Bellman backups, their transposes and linear systems.

`engine_for` chooses once per MDP who does it: NumPy and SciPy, or from COMPILED_FROM states on code
that numba compiles, where the extra `fast` is installed. Compiled code goes without a list of the
entries of P, which takes a fifth of the time and of the memory at a million states; below the limit
it saves less than it takes to load. The results of both are equal up to rounding.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.util import find_spec
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.bellman.linear.linear_solver import LinearSolver, LinearSystem
from serd_core.bellman.linear.policy_pattern import EntryPattern, PolicyPattern, policy_pattern
from serd_core.dynamics.transition_model import TransitionModel, Transitions

if TYPE_CHECKING:
    from serd_core.bellman.bellman_solver import BellmanProblem

#: States from which compiled code saves more than loading it costs.
COMPILED_FROM = 200_000


@dataclass(eq=False)
class Engine:
    """What solvers and gradients need of the transitions of one model, by SciPy and NumPy.

    sweeps: whether `settled` improves values of the soft Bellman equation.
    """

    sweeps: ClassVar[bool] = False

    model: TransitionModel

    @cached_property
    def pattern(self) -> PolicyPattern:
        """Symbolic structure of I - gamma P_pi, the same for all policies and parameters."""
        model = self.model
        return policy_pattern(model.row, model.successor, model.n_states, model.n_actions)

    def q(self, problem: BellmanProblem, value: FloatArray) -> FloatArray:
        """(S, A) R + gamma P V, -inf where an action is unavailable."""
        q = problem.transitions.expected(value)
        q *= problem.discount
        q += problem.rewards
        return q

    def backup(
        self, problem: BellmanProblem, value: FloatArray
    ) -> tuple[FloatArray, FloatArray | None]:
        """(S,) T V, and its (S, A) Q where it was computed as a table."""
        q = self.q(problem, value)
        return problem.equation.maximum(q), q

    def settled(self, problem: BellmanProblem, value: FloatArray, smallest: float) -> FloatArray:
        """(S,) value after Gauss-Seidel sweeps of the soft equation, by turns in and against the
        states' order; here the value itself.

        smallest: after the first sweep, states are visited only where their value or that of a
        state that leads to them moved by more.
        """
        del problem, smallest
        return value

    def flow(self, transitions: Transitions, weights: FloatArray) -> FloatArray:
        """(S,) transposed product sum_{s,a} P(s'|s,a) weights(s,a)."""
        return np.asarray(transitions.matrix.T @ weights.ravel())

    def local_gradient(
        self, transitions: Transitions, weights: FloatArray, values: FloatArray
    ) -> FloatArray:
        """Gradient of sum weights(s, a) P(s' | s, a) values(s') by the local probabilities."""
        model = transitions.model
        by_entry = np.take(weights.ravel(), model.row)
        by_entry *= np.take(values, model.successor)
        return model.gather(by_entry)

    def system(
        self,
        transitions: Transitions,
        policy: FloatArray,
        discount: float,
        solver: LinearSolver,
    ) -> LinearSystem:
        """I - discount * P_pi for an (S, A) policy, prepared by a solver."""
        pattern = self.pattern
        assert isinstance(pattern, EntryPattern)
        data = pattern.system_data(policy, transitions.entries, discount)
        return solver.prepare(pattern, data)


def engine_for(model: TransitionModel, compiled_from: int = COMPILED_FROM) -> Engine:
    """The engine of a model: compiled from a number of states on, if compiled code works here."""
    if is_large(model.n_states, compiled_from) and _compiled_code_works():
        from serd_core.bellman.compiled.compiled_engine import CompiledEngine

        return CompiledEngine(model)
    return Engine(model)


def is_large(n_states: int, compiled_from: int = COMPILED_FROM) -> bool:
    """Whether compiled code pays for this number of states, and numba is installed."""
    return compiled_from <= n_states < 2**31 and find_spec("numba") is not None


@cache
def _compiled_code_works() -> bool:
    """Whether compiled code solves a small problem; a warning gives the reason where it does not.

    That compiles or loads everything, so that what fails does so here: numba itself, a compilation,
    or its cache, which needs a folder that can be written to.
    """
    try:
        from serd_core.bellman.compiled.compiled_engine import rehearse

        rehearse()
    except Exception as error:  # whatever the reason: SciPy gives the same results
        warnings.warn(
            f"compiled code is not used, large problems take longer: {type(error).__name__}:"
            f" {str(error).splitlines()[0] if str(error) else 'no reason given'}",
            RuntimeWarning,
            stacklevel=2,
        )
        return False
    return True
