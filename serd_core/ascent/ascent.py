"""What every ascent offers, what it is given and what it returns."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, first_index
from serd_core.derivatives.differences import gradient_differences
from serd_core.errors import SerdError

#: Why an ascent ended.
CONVERGED = "gradient within tolerance"
STOPPED = "stopped by the observer"
OUT_OF_STEPS = "not converged: out of steps"
DIVERGED = "not converged: a step led where the objective is no number; use smaller steps"


class Objective(ABC):
    """What is climbed: a function of a vector (n,) with its derivatives."""

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
    """Progress after one accepted step; `vector` is where the ascent stands."""

    number: int
    objective: float
    gradient_norm: float
    n_evaluations: int
    vector: FloatArray


#: Told after each step; True asks the ascent to stop there (early stopping).
StepObserver = Callable[[Step], bool]


@dataclass(frozen=True, eq=False)
class AscentResult:
    """Where an ascent ended; converged means the gradient norm is within its tolerance."""

    vector: FloatArray
    objective: float
    gradient_norm: float
    n_steps: int
    n_evaluations: int
    converged: bool
    message: str
    objective_trace: FloatArray


class Ascent(ABC):
    """A bounded search for a maximum from a given start."""

    @abstractmethod
    def maximise(
        self, objective: Objective, start: FloatArray, observer: StepObserver
    ) -> AscentResult:
        """Climb from `start` (n,)."""


def require_limits(gradient_tolerance: float, max_steps: int) -> None:
    """SerdError unless an ascent with these limits can end, and end for a reason."""
    if not gradient_tolerance >= 0:
        raise SerdError(
            f"gradient_tolerance must not be negative or NaN, got {gradient_tolerance}; use 1e-6"
        )
    if not max_steps >= 0:
        raise SerdError(f"max_steps must not be negative or NaN, got {max_steps}; use 500")


def evaluate_at(objective: Objective, vector: FloatArray) -> tuple[float, FloatArray]:
    """Value and (n,) gradient; SerdError where the ascent has left the numbers."""
    bad = first_index(~np.isfinite(vector))
    if bad is not None:
        raise SerdError(
            f"the ascent must stay at finite parameters, but parameter {bad[0]} of"
            f" {len(vector)} became {vector[bad]}; start from smaller weights or scale the features"
        )
    return objective.evaluate(vector)


def largest(gradient: FloatArray) -> float:
    """Largest absolute entry, 0 for an empty vector."""
    return float(np.max(np.abs(gradient), initial=0.0))
