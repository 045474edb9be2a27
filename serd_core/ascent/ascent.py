"""The loop of the ascents, and L-BFGS of SciPy, stopped by the gradient and nothing weaker.

An ascent gives the steps (`Ascent.tries`); when it ends, and what it reports, is decided here.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import scipy.optimize

from serd_core.arrays import FloatArray, first_index, gradient_differences
from serd_core.checks import is_number, shown
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
    newton_decrement: length of the Newton step there, in standard errors; NaN where unknown.
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
    newton_decrement: float = np.nan


class Ascent(ABC):
    """A bounded search for a maximum from a given start; `tolerance` names its field of that."""

    tolerance: ClassVar[str] = "gradient_tolerance"
    max_steps: int

    def __post_init__(self) -> None:
        for name, example in ((self.tolerance, "1e-6"), ("max_steps", "500")):
            value = getattr(self, name)
            if not (is_number(value) and value >= 0):
                raise SerdError(
                    f"{name} must not be negative or NaN, got {shown(value)}; use {example}"
                )

    @abstractmethod
    def tries(self, climb: "Climb") -> Iterator[None]:
        """Judge where the climb is, then try one step after another; yields after each."""

    def maximise(
        self, objective: Objective, start: FloatArray, on_step: StepCallback | None = None
    ) -> AscentResult:
        """Climb from `start` (n,) to a maximum, unless `on_step` stops it or steps run out."""
        climb = Climb(objective, on_step, np.array(start, dtype=np.float64))
        climb.follow(self.tries(climb), self.max_steps)
        return climb.result()


@dataclass(frozen=True, eq=False)
class Scaled(Objective):
    """An objective over its vector in units of `scale` (n,)."""

    objective: Objective
    scale: FloatArray

    def evaluate(self, vector: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = self.objective.evaluate(vector * self.scale)
        return value, gradient * self.scale

    def hessian(self, vector: FloatArray) -> FloatArray:
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


class Climb:
    """One ascent under way: where it is, whether that is a maximum, and the way to there.

    here: the point of the last step; norm: what is tested for convergence there; maximum: the
    message where it is a maximum, else empty; trace: the objective after each step; stalled: why
    the tries end, and by_rounding whether because rounding hides what a step gains.
    """

    def __init__(
        self, objective: Objective, on_step: StepCallback | None, start: FloatArray
    ) -> None:
        self.objective, self.on_step = objective, on_step
        self.trace: list[float] = []
        self.n_evaluations = 0
        self.stopped = self.by_rounding = False
        self.maximum = self.stalled = self.message = ""
        self._last: Point | None = None
        self.here = self.evaluate(start)
        self.norm = self.here.gradient_norm

    def evaluate(self, vector: FloatArray) -> Point:
        """The objective at a vector, kept where that was the last one."""
        if self._last is not None and np.array_equal(vector, self._last.vector):
            return self._last
        if (bad := first_index(~np.isfinite(vector))) is not None:
            raise SerdError(
                f"the ascent must stay at finite parameters, but parameter {bad[0]} of"
                f" {len(vector)} became {vector[bad]}; start from smaller weights or scale the"
                " features"
            )
        self.n_evaluations += 1
        vector = vector.copy()  # minimisers of SciPy go on in the same array
        self._last = Point(vector, *self.objective.evaluate(vector))
        return self._last

    def judge(self, norm: float, maximum: str) -> None:
        """Set whether the present point is a maximum: its `norm` and `maximum`."""
        self.norm, self.maximum = norm, maximum

    def accept(self, point: Point, norm: float, maximum: str) -> None:
        """Step to a point with its `norm` and `maximum`, and call back."""
        self.here, self.norm, self.maximum = point, norm, maximum
        self.trace.append(point.value)
        if self.on_step is not None:
            step = Step(len(self.trace), point.value, norm, self.n_evaluations, point.vector)
            self.stopped = bool(self.on_step(step))

    @property
    def over(self) -> bool:
        """Whether the present point is a maximum, or the callback stopped the ascent there."""
        return self.stopped or bool(self.maximum)

    def follow(self, tries: Iterator[None], max_steps: int) -> None:
        """The loop of every ascent: make tries until over, out of them, or no step gains."""
        for number, _ in enumerate(tries):
            if self.over:
                break
            if number >= max_steps:
                self.message = OUT_OF_STEPS
                return
        self.message = self.maximum or (STOPPED if self.stopped else self.stalled)

    def result(self) -> AscentResult:
        """The record of the ascent."""
        return AscentResult(
            vector=self.here.vector,
            objective=self.here.value,
            gradient_norm=self.norm,
            n_steps=len(self.trace),
            n_evaluations=self.n_evaluations,
            converged=bool(self.maximum),
            message=self.message,
            objective_trace=np.array(self.trace),
            by_rounding=self.by_rounding and not self.over,
        )


def vanishing(point: Point, gradient_tolerance: float) -> tuple[float, str]:
    """Norm of the gradient, and the message of a maximum where that is within the tolerance."""
    norm = point.gradient_norm
    return norm, CONVERGED if norm <= gradient_tolerance else ""


def largest(gradient: FloatArray) -> float:
    """Largest absolute entry, 0 for an empty vector."""
    return float(np.max(np.abs(gradient), initial=0.0))


@dataclass(frozen=True)
class Lbfgs(Ascent):
    """L-BFGS, which needs values and gradients only: the ascent for many parameters.

    It has converged where the largest gradient entry is at most `gradient_tolerance`; memory: pairs
    of steps and gradients that it keeps.

        fit = sc.fit_mdce_irl_by_likelihood(problem, decisions, rng=rng, ascent=sc.Lbfgs(1e-8))
    """

    gradient_tolerance: float = 1e-6
    max_steps: int = 5_000
    memory: int = 30

    def tries(self, climb: Climb) -> Iterator[None]:
        """Run SciPy's, once more where its line search stalls by rounding."""
        climb.judge(*vanishing(climb.here, self.gradient_tolerance))
        yield

        def accept(vector: FloatArray) -> None:
            point = climb.evaluate(vector)
            climb.accept(point, *vanishing(point, self.gradient_tolerance))

        for _ in range(2):
            reason = minimise(
                climb,
                climb.here.vector,
                accept,
                maxiter=self.max_steps - len(climb.trace),
                maxfun=20 * self.max_steps,
                maxcor=self.memory,
                gtol=self.gradient_tolerance,
            )
            if len(climb.trace) >= self.max_steps:
                climb.stalled, climb.by_rounding = OUT_OF_STEPS, False
                return
            climb.stalled, climb.by_rounding = f"not converged: {reason}", True
            yield


LBFGS = Lbfgs()


def minimise(
    climb: Climb,
    start: FloatArray,
    accept: Callable[[FloatArray], None],
    bounds: list[tuple[float, float]] | None = None,
    **options: Any,
) -> str:
    """Why L-BFGS-B of SciPy ended, which gives `accept` the vector of each step."""

    def negated(vector: FloatArray) -> tuple[float, FloatArray]:
        point = climb.evaluate(vector)
        return -point.value, -point.gradient

    def after_step(intermediate_result: scipy.optimize.OptimizeResult) -> None:
        accept(np.asarray(intermediate_result.x))
        if climb.stopped:
            raise StopIteration

    ended = scipy.optimize.minimize(
        negated,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        callback=after_step,
        options={"ftol": 0.0, "maxls": 40, **options},
    )
    return str(ended.message)
