"""What every ascent takes and returns, and the record it keeps on the way."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from serd_core.arrays import FloatArray, first_index, gradient_differences, is_number, shown
from serd_core.errors import SerdError

#: Why an ascent ended.
CONVERGED = "gradient within tolerance"
AT_MAXIMUM = "Newton step within tolerance"
AT_A_KINK = "gradients on the sides of a kink cancel within tolerance"
STOPPED = "stopped by the callback"
OUT_OF_STEPS = "not converged: out of steps"


class Objective(ABC):
    """A function of a vector (n,) to maximise, with its derivatives."""

    @abstractmethod
    def evaluate(self, vector: FloatArray) -> tuple[float, FloatArray]:
        """Value and (n,) gradient."""

    def hessian(self, vector: FloatArray) -> FloatArray:
        """(n, n) second derivatives; by central differences of the gradient unless overridden."""
        return gradient_differences(lambda at: self.evaluate(at)[1], vector)


@dataclass(frozen=True)
class FunctionObjective(Objective):
    """An objective given as one function of a vector, returning value and gradient."""

    function: Callable[[FloatArray], tuple[float, FloatArray]]

    def evaluate(self, vector: FloatArray) -> tuple[float, FloatArray]:
        """Value and (n,) gradient."""
        return self.function(vector)


@dataclass(frozen=True, eq=False)
class Step:
    """Progress after one accepted step; `vector` is the point it reached."""

    number: int
    objective: float
    gradient_norm: float
    n_evaluations: int
    vector: FloatArray


#: Called after each step; returning True stops the ascent there.
StepCallback = Callable[[Step], bool | None]


@dataclass(frozen=True, eq=False)
class AscentResult:
    """Where an ascent ended; converged means the gradient norm is within its tolerance.

    by_rounding: whether it did not converge because rounding hides what a step gains.
    """

    vector: FloatArray
    objective: float
    gradient_norm: float
    n_steps: int
    n_evaluations: int
    converged: bool
    message: str
    objective_trace: FloatArray
    by_rounding: bool = False


class Ascent(ABC):
    """A bounded search for a maximum from a given start."""

    @abstractmethod
    def maximise(
        self, objective: Objective, start: FloatArray, on_step: StepCallback | None = None
    ) -> AscentResult:
        """Climb from `start` (n,)."""


@dataclass(frozen=True, eq=False)
class Scaled(Objective):
    """An objective over its vector in units of `scale` (n,)."""

    objective: Objective
    scale: FloatArray

    def evaluate(self, vector: FloatArray) -> tuple[float, FloatArray]:
        """Value and (n,) gradient."""
        value, gradient = self.objective.evaluate(vector * self.scale)
        return value, gradient * self.scale

    def hessian(self, vector: FloatArray) -> FloatArray:
        """(n, n) second derivatives."""
        table = self.objective.hessian(vector * self.scale)
        return np.asarray(table * np.outer(self.scale, self.scale))

    def maximum(
        self, ascent: Ascent, start: FloatArray, on_step: StepCallback | None = None
    ) -> AscentResult:
        """The end of an ascent from `start` in these units; all vectors are in their own."""

        def in_own_units(step: Step) -> bool | None:
            assert on_step is not None
            return on_step(replace(step, vector=step.vector * self.scale))

        callback = None if on_step is None else in_own_units
        found = ascent.maximise(self, start / self.scale, callback)
        return replace(found, vector=found.vector * self.scale)


@dataclass(frozen=True, eq=False)
class Point:
    """A vector (n,) with the objective's value and (n,) gradient there."""

    vector: FloatArray
    value: float
    gradient: FloatArray

    @property
    def gradient_norm(self) -> float:
        """Largest absolute entry of the gradient."""
        return largest(self.gradient)


@dataclass(eq=False)
class Climb:
    """Record of one ascent under way: evaluations, objective after each step, whether stopped."""

    objective: Objective
    on_step: StepCallback | None
    trace: list[float] = field(default_factory=list)
    n_evaluations: int = 0
    stopped: bool = False
    last: Point | None = None

    def evaluate(self, vector: FloatArray) -> Point:
        """The objective at a vector, kept where that was the last one.

        SerdError where an entry of the vector is not finite.
        """
        if self.last is not None and np.array_equal(vector, self.last.vector):
            return self.last
        if (bad := first_index(~np.isfinite(vector))) is not None:
            raise SerdError(
                f"the ascent must stay at finite parameters, but parameter {bad[0]} of"
                f" {len(vector)} became {vector[bad]}; start from smaller weights or scale the"
                " features"
            )
        self.n_evaluations += 1
        vector = vector.copy()  # minimisers of SciPy go on in the same array
        self.last = Point(vector, *self.objective.evaluate(vector))
        return self.last

    def negated(self, vector: FloatArray) -> tuple[float, FloatArray]:
        """Minus the objective and its gradient, for minimisers of SciPy."""
        point = self.evaluate(vector)
        return -point.value, -point.gradient

    def accept(self, point: Point, gradient_norm: float | None = None) -> None:
        """Record a step to the point and call back.

        gradient_norm: what the ascent tests for convergence; None for the point's own.
        """
        self.trace.append(point.value)
        if self.on_step is not None:
            norm = point.gradient_norm if gradient_norm is None else gradient_norm
            step = Step(len(self.trace), point.value, norm, self.n_evaluations, point.vector)
            self.stopped = bool(self.on_step(step))

    def result(
        self, end: Point, tolerance: float, otherwise: str, gradient_norm: float | None = None
    ) -> AscentResult:
        """The record of the ascent; otherwise: message where it neither converged nor was stopped.

        gradient_norm: as in `accept`.
        """
        norm = end.gradient_norm if gradient_norm is None else gradient_norm
        if end.gradient_norm <= tolerance:
            message = CONVERGED
        elif norm <= tolerance:
            message = AT_A_KINK
        else:
            message = STOPPED if self.stopped else otherwise
        return self._record(end, norm, min(norm, end.gradient_norm) <= tolerance, message)

    def certified(self, end: Point, norm: float, at_maximum: bool, otherwise: str) -> AscentResult:
        """The record of an ascent that its Newton step, of length `norm`, certifies or does not."""
        missed = STOPPED if self.stopped else otherwise
        return self._record(end, norm, at_maximum, AT_MAXIMUM if at_maximum else missed)

    def _record(self, end: Point, norm: float, converged: bool, message: str) -> AscentResult:
        return AscentResult(
            vector=end.vector,
            objective=end.value,
            gradient_norm=norm,
            n_steps=len(self.trace),
            n_evaluations=self.n_evaluations,
            converged=converged,
            message=message,
            objective_trace=np.array(self.trace),
        )


def require_limits(gradient_tolerance: float, max_steps: int) -> None:
    """SerdError unless an ascent with these limits can end, and end for a reason."""
    for name, value, example in (
        ("gradient_tolerance", gradient_tolerance, "1e-6"),
        ("max_steps", max_steps, "500"),
    ):
        if not (is_number(value) and value >= 0):
            raise SerdError(
                f"{name} must not be negative or NaN, got {shown(value)}; use {example}"
            )


def largest(gradient: FloatArray) -> float:
    """Largest absolute entry, 0 for an empty vector."""
    return float(np.max(np.abs(gradient), initial=0.0))
