"""Whether a fit has converged: Newton's method goes on from where its ascent ended, and stays.

The gradient alone does not show it: it is small where a feature has small values, where decisions
are separable, and along directions that no decision informs. The Newton step in standard errors
distinguishes these (`serd_core.ascent.trust_region`). Where an objective has kinks, or is no log
density, the ascent is taken at its word unless a direction is open
(`serd_core.ascent.open_directions`).
"""

from dataclasses import replace

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import AT_A_KINK, AT_MAXIMUM, AscentResult, Step, StepCallback
from serd_core.ascent.open_directions import OpenDirections, open_directions
from serd_core.ascent.trust_region import Curvature, NewtonAscent
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
    if found.converged or step.at_maximum():
        if not counted.converged:
            counted = replace(counted, converged=True, message=AT_MAXIMUM)
        move = found.vector - start
        if float(np.sqrt(move @ -objective.hessian(found.vector) @ move)) <= CLOSE:
            return parameters, counted, ()
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
