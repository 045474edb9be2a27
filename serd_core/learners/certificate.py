"""Whether a fit has converged: Newton's method goes on from where its ascent ended, and stays.

The gradient alone does not show it: it is small where a feature has small values, where decisions
are separable, and along directions that no decision informs. The Newton step in standard errors
distinguishes these (`serd_core.ascent.trust_region`). Where an objective has kinks, or is no log
density, the ascent is taken at its word unless a direction is open: the objective is nowhere lower
than at the point, one way, and does not fall any more far away, as a weak prior would make it. It
is looked for among directions of hardly any curvature, the Newton step, and the way from the
origin. Numbers must be of comparable scale.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from serd_core.arrays import FloatArray, described
from serd_core.ascent.ascent import (
    AT_A_KINK,
    AT_MAXIMUM,
    STOPPED,
    AscentResult,
    Objective,
    Step,
    StepCallback,
)
from serd_core.ascent.trust_region import Curvature, NewtonAscent
from serd_core.errors import SerdError
from serd_core.posterior.beliefs import Belief
from serd_core.posterior.coordinates import (
    Coordinates,
    LogPosterior,
    coordinates,
    free_in_use,
    free_scaling,
)
from serd_core.posterior.parameters import Parameters
from serd_core.posterior.posterior import Posterior

#: Distances at which values are compared, and at which the objective must not fall any more.
NEAR, FAR = (1.0, 10.0), (100.0, 300.0)
#: Distance from the origin from which on these are in proportion to it.
DISTANT = 1e3
#: Differences, and slopes, of the objective relative to its size or to 1 that are none.
NO_GAIN, NO_SLOPE = 1e-9, 1e-12
#: Largest gradient where one may have vanished.
VANISHING = 1e-3
#: Share of the largest curvature up to which a direction has hardly any.
WEAK = 1e-6
#: Share of the largest part of a direction up to which others may be left out.
SMALL = 1e-2


@dataclass(frozen=True, eq=False)
class OpenDirections:
    """growing: (g, n) directions along which the objective grows on and on; flat: (f, n)."""

    growing: FloatArray
    flat: FloatArray

    def judge(
        self, ascended: AscentResult, describe: Callable[[FloatArray], str], fix: str
    ) -> AscentResult:
        """The ascent, which has not converged where a direction is open."""
        if len(self.growing):
            way = describe(self.growing[0])
            reason = f"the objective grows on and on along {way} (separable decisions)"
        elif len(self.flat):
            reason = f"nothing determines {describe(self.flat[0])}"
        else:
            return ascended
        return replace(ascended, converged=False, message=f"not converged: {reason}; {fix}")


def judged_weights(
    objective: Objective,
    ended: AscentResult,
    scale: FloatArray,
    names: Sequence[str],
    fix: str,
    n_observations: float = 1.0,
) -> tuple[AscentResult, tuple[str, ...]]:
    """The end of an ascent over weights, and directions that nothing determines, in words.

    n_observations: of which the objective is a mean, so that the length of the Newton step counts
    standard errors.
    """
    near = ended.converged or ended.by_rounding or ended.gradient_norm <= VANISHING
    if ended.message == STOPPED or not near:
        return ended, ()
    describe, at = partial(described, names=names), ended.vector / scale
    step = Curvature(*np.linalg.eigh(-objective.hessian(at))).newton(objective.evaluate(at)[1])
    decrement = float(np.sqrt(n_observations)) * step.standard_errors
    ended = replace(ended, newton_decrement=decrement)
    found = open_directions(objective, at)
    return found.judge(ended, describe, fix), tuple(map(describe, found.flat))


def open_directions(
    objective: Objective, at: FloatArray, *, kinked: bool = False
) -> OpenDirections:
    """Find the open directions from a point (n,) where an ascent has ended."""
    curvatures, vectors = np.linalg.eigh(-objective.hessian(at))
    value, gradient = objective.evaluate(at)
    sizes, left = np.abs(curvatures), 0.0 if kinked else float(np.linalg.norm(gradient))
    weak = sizes <= WEAK * sizes.max(initial=0.0) + left
    slopes = vectors.T @ gradient
    newton = vectors @ np.divide(slopes, sizes, out=np.zeros_like(slopes), where=sizes > 0)
    growing, flat = np.zeros((2, 0, len(at)))
    for direction in (*vectors[:, weak].T, newton, at):
        for unit in _ways(direction):
            gain = _gain(objective, at, unit, value)
            if gain > NO_GAIN:
                growing = _with(growing, unit)
            elif gain >= -NO_GAIN:
                flat = _with(flat, unit)
            if gain >= -NO_GAIN:
                break
    return OpenDirections(growing, flat)


def _with(directions: FloatArray, unit: FloatArray) -> FloatArray:
    """The directions (k, n) and another one, unless these span it."""
    left = unit - np.linalg.lstsq(directions.T, unit, rcond=None)[0] @ directions
    return directions if np.linalg.norm(left) < SMALL else np.vstack([directions, unit])


def _ways(direction: FloatArray) -> Iterator[FloatArray]:
    """Unit vectors both ways, first along its large parts only."""
    parts = np.abs(direction)
    for kept in (np.where(parts > SMALL * parts.max(), direction, 0.0), direction):
        length = float(np.linalg.norm(kept))
        if 0.0 < length < np.inf:
            yield kept / length
            yield -kept / length


def _gain(objective: Objective, at: FloatArray, direction: FloatArray, value: float) -> float:
    """Least gain of the objective over the value at the point, relative to its size."""
    size, unit = max(1.0, abs(value)), max(1.0, float(np.linalg.norm(at)) / DISTANT)
    least = np.inf
    try:
        with np.errstate(all="ignore"):
            for step in NEAR:
                gain = (objective.evaluate(at + unit * step * direction)[0] - value) / size
                if not gain >= -NO_GAIN:
                    return -np.inf
                least = min(least, gain)
            for step in FAR:
                gradient = objective.evaluate(at + unit * step * direction)[1]
                if not gradient @ direction / size >= -NO_SLOPE:
                    return -np.inf
    except SerdError:
        return -np.inf
    return least


#: Distance from the maximum, in standard errors, at which the end of an ascent is left as it is.
CLOSE = 1e-3
#: Newton steps from the end of an ascent; from a maximum three suffice.
FINAL_STEPS = 20
_NO_EFFECT = 1e-8


#: Where an ascent ends, what that is worth, and directions that nothing determines.
Certificate = tuple[Parameters, AscentResult, tuple[str, ...]]


def certificate(
    posterior: Posterior,
    belief: Belief,
    parameters: Parameters,
    ascended: AscentResult,
    on_step: StepCallback | None = None,
) -> Certificate:
    """The end of the ascent, or the maximum nearby, to which `on_step` is called once."""
    if not (ascended.converged or ascended.by_rounding):
        return parameters, ascended, ()
    space = coordinates(posterior.problem, belief, parameters)
    objective = LogPosterior(posterior, space)
    start = space.of(parameters)
    if not posterior.policy_model.equation.curved or ascended.message == AT_A_KINK:
        return _with_kinks(objective, parameters, ascended)
    found = NewtonAscent(max_steps=FINAL_STEPS).maximise(objective, start)
    counted = replace(ascended, n_evaluations=ascended.n_evaluations + found.n_evaluations)
    curvature = Curvature(*np.linalg.eigh(-objective.hessian(found.vector)))
    step = curvature.newton(objective.evaluate(found.vector)[1])
    step = replace(step, flat=_with_effect(posterior, space, step.flat))
    counted = replace(counted, newton_decrement=step.standard_errors)
    if found.converged or step.at_maximum():
        if not counted.converged:
            counted = replace(counted, converged=True, message=AT_MAXIMUM)
        move = found.vector - start
        apart = float(np.sqrt(move @ -objective.hessian(found.vector) @ move))
        if apart <= CLOSE:
            return parameters, replace(counted, newton_decrement=apart), ()
        mean, number = found.objective / posterior.observations.n_decisions, ascended.n_steps + 1
        if on_step is not None:
            vector = space.table @ found.vector
            on_step(Step(number, mean, ascended.gradient_norm, counted.n_evaluations, vector))
        trace = np.append(ascended.objective_trace, mean)
        moved = replace(counted, n_steps=number, objective_trace=trace)
        return space.parameters(found.vector), moved, ()
    if len(step.rising):
        bent = space.describe(step.rising[0])
        reason = f"the log posterior bends up along {bent} (a saddle point); start elsewhere"
        return parameters, _failed(counted, reason), ()
    failed = _failed(counted, f"Newton step of {step.standard_errors:.2g} standard errors")
    # Farther on, growth would be lost in rounding.
    growing = open_directions(objective, start).growing
    return _judged(OpenDirections(growing, step.flat), space, parameters, failed)


def _failed(ascended: AscentResult, reason: str) -> AscentResult:
    return replace(ascended, converged=False, message=f"not converged: {reason}")


def _judged(
    found: OpenDirections, space: Coordinates, parameters: Parameters, ascended: AscentResult
) -> Certificate:
    judged = found.judge(ascended, space.describe, "give these numbers a prior")
    return parameters, judged, tuple(map(space.describe, found.flat))


def _with_kinks(
    objective: LogPosterior, parameters: Parameters, ascended: AscentResult
) -> Certificate:
    """The end of the ascent, with the scale that weights and temperature have in common."""
    posterior, space = objective.posterior, objective.coordinates
    kinked = ascended.message == AT_A_KINK
    found = open_directions(objective, space.of(parameters), kinked=kinked)
    flat = _with_effect(posterior, space, found.flat)
    scaling = free_scaling(posterior, parameters, space.belief.jacobian(parameters))
    if scaling is not None:
        flat = np.vstack([flat, space.of_free(scaling)])
    return _judged(OpenDirections(found.growing, flat), space, parameters, ascended)


def _with_effect(posterior: Posterior, space: Coordinates, directions: FloatArray) -> FloatArray:
    """(k, d) of the span of (n, d) directions, those that move numbers in use."""
    jacobian = space.belief.jacobian(space.like)
    in_use = free_in_use(posterior.problem, space.like, jacobian)
    units = space.units()
    moved = (directions @ (space.table / units[:, None]).T)[:, in_use]
    weights, sizes, _ = np.linalg.svd(moved, full_matrices=False)
    return np.asarray(weights[:, sizes > _NO_EFFECT].T @ directions)
