"""Ascent of objectives with kinks, such as likelihoods of policies over optimal Q-values.

Where the greedy policy changes, the gradient of PM SERD jumps, and its maxima often lie just there:
each side slopes up towards the kink and no gradient ever vanishes. Smooth methods end with steps
too short to matter. This one goes on with BFGS and a weak Wolfe line search, which copes with kinks
(Lewis and Overton, Mathematical Programming 141, 2013), and stops where some mean of the gradients
found within a small neighbourhood vanishes (Burke, Lewis and Overton, SIAM J. Optim. 15, 2005):

    min over shares w >= 0, sum w = 1  of  |sum_j w_j g_j|  close to 0

Where no step gains anything that mean gives the direction, and each failure adds a gradient to it.
"""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import (
    CONVERGED,
    OUT_OF_STEPS,
    STOPPED,
    Ascent,
    AscentResult,
    Objective,
    Step,
    StepObserver,
    evaluate_at,
    largest,
    require_limits,
)
from serd_core.ascent.inverse_metric import first_metric, updated_metric
from serd_core.ascent.smallest_mean import smallest_mean
from serd_core.ascent.trust_region import TrustRegion

#: Weak Wolfe: a step gains this share of what its slope promises, and lowers the slope to that.
GAIN, LOWER = 1e-4, 0.9
#: Trials of a line search (each halves an interval or doubles the step), and of directions.
MAX_TRIALS, MAX_DIRECTIONS = 50, 50
TINY = float(np.finfo(np.float64).tiny)
AT_A_KINK = "gradients on the sides of a kink cancel within tolerance"
STALLED = "not converged: no step gains anything and the gradients around do not cancel"


@dataclass(frozen=True)
class KinkedAscent(Ascent):
    """A smooth ascent, then BFGS from where that one stalled.

    gradient_tolerance: for the gradient, or the smallest mean of the gradients around; around means
    within neighbourhood * max(1, |x|). The gradient norm of the result is that of this mean.
    longest_step: bound of |x - previous x|; a logarithm among x must not run away in one step.
    """

    smooth: Ascent = field(default_factory=TrustRegion)
    gradient_tolerance: float = 1e-6
    neighbourhood: float = 1e-6
    max_steps: int = 1_000
    longest_step: float = 10.0

    def __post_init__(self) -> None:
        require_limits(self.gradient_tolerance, self.max_steps)

    def maximise(
        self, objective: Objective, start: FloatArray, observer: StepObserver
    ) -> AscentResult:
        """Climb until a gradient or a mean of gradients vanishes, or nothing is gained any more."""
        began = self.smooth.maximise(objective, start, observer)
        if began.converged or began.message == STOPPED:
            return began
        run = _Run(objective, self, began, observer)
        message = run.climb()
        return AscentResult(
            vector=run.here.vector,
            objective=run.here.value,
            gradient_norm=run.mean_norm,
            n_steps=len(run.trace),
            n_evaluations=run.n_evaluations,
            converged=run.mean_norm <= self.gradient_tolerance,
            message=message,
            objective_trace=np.array(run.trace),
        )


@dataclass(frozen=True, eq=False)
class _Place:
    vector: FloatArray
    value: float
    gradient: FloatArray


class _Run:
    """One climb: where it stands, the inverse metric, and the places seen lately."""

    def __init__(
        self,
        objective: Objective,
        settings: KinkedAscent,
        began: AscentResult,
        observer: StepObserver,
    ) -> None:
        self.objective, self.settings, self.observer = objective, settings, observer
        self.trace = list(began.objective_trace)
        self.n_evaluations = began.n_evaluations
        self.seen: deque[_Place] = deque(maxlen=2 * len(began.vector) + 20)
        self.steepest_down: list[_Place] = []
        self.here = self._visit(began.vector)
        self.metric = first_metric(objective.hessian(began.vector))
        self.mean_norm = largest(self.here.gradient)

    def climb(self) -> str:
        """Step until done; returns why."""
        for _ in range(self.settings.max_steps):
            moved = self._step()
            self.mean_norm = largest(smallest_mean(self._gradients_around()))
            stopped = moved and self._told()
            if largest(self.here.gradient) <= self.settings.gradient_tolerance:
                return CONVERGED
            if self.mean_norm <= self.settings.gradient_tolerance:
                return AT_A_KINK
            if not moved:
                return STALLED
            if stopped:
                return STOPPED
        return OUT_OF_STEPS

    def _step(self) -> bool:
        """One BFGS step; False where nothing was gained."""
        direction = self.metric @ self.here.gradient
        there = self._search(direction, float(self.here.gradient @ direction))
        there = there or self._across_kinks()
        if there is None:
            return False
        moved = there.vector - self.here.vector
        self.metric = updated_metric(self.metric, moved, self.here.gradient - there.gradient)
        self.here, self.steepest_down = there, []
        self.trace.append(there.value)
        return True

    def _search(self, direction: FloatArray, slope: float) -> _Place | None:
        """A place along the direction that meets the weak Wolfe conditions, or at least gains."""
        longest = self.settings.longest_step / max(float(np.linalg.norm(direction)), TINY)
        short, long, length, found = 0.0, np.inf, min(1.0, longest), None
        for _ in range(MAX_TRIALS):
            there = self._visit(self.here.vector + length * direction)
            if not self._gains(there, GAIN * length * slope):
                long = length
            elif float(there.gradient @ direction) > LOWER * slope:
                short, found = length, there
            else:
                return there
            if short >= longest:
                return found
            length = min(2.0 * short, longest) if np.isinf(long) else 0.5 * (short + long)
        return found

    def _gains(self, there: _Place, wanted: float) -> bool:
        """Whether a place is higher by as much as wanted; by nothing at all is no gain.

        Near a kink `wanted` drowns in rounding, and steps to the same height would go on for ever.
        """
        return there.value >= self.here.value + wanted and there.value > self.here.value

    def _across_kinks(self) -> _Place | None:
        """A gain along the smallest mean of the gradients around, as the metric measures them."""
        self.metric = first_metric(self.objective.hessian(self.here.vector))
        root = np.linalg.cholesky(self.metric)
        for _ in range(MAX_DIRECTIONS):
            mean = np.linalg.solve(root.T, smallest_mean(self._gradients_around() @ root))
            if largest(mean) <= self.settings.gradient_tolerance:
                return None
            direction = self.metric @ mean
            there = self._search(direction, float(mean @ direction))
            if there is not None:
                return there
            # What failed the direction must not be forgotten, or the next may fail the same way.
            self.steepest_down.append(
                min(self._places_around(), key=lambda place: float(place.gradient @ direction))
            )
        return None

    def _visit(self, vector: FloatArray) -> _Place:
        value, gradient = evaluate_at(self.objective, vector)
        self.n_evaluations += 1
        place = _Place(vector, value, gradient)
        if np.isfinite(value):
            self.seen.append(place)
        return place

    def _gradients_around(self) -> FloatArray:
        """(k, n) gradients seen within the neighbourhood, the present one first."""
        return np.array([place.gradient for place in self._places_around()])

    def _places_around(self) -> list[_Place]:
        here = self.here.vector
        radius = self.settings.neighbourhood * max(1.0, float(np.linalg.norm(here)))
        others = [
            place
            for place in (*self.seen, *self.steepest_down)
            if place is not self.here and np.linalg.norm(place.vector - here) <= radius
        ]
        return [self.here, *others]

    def _told(self) -> bool:
        here = self.here
        return self.observer(
            Step(len(self.trace), here.value, self.mean_norm, self.n_evaluations, here.vector)
        )
