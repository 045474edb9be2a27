"""Whether a fit has converged: Newton's method goes on from where its ascent ended, and stays.

The gradient alone does not show it. It is small where a feature has small values, where decisions
agree so well that the likelihood grows without end (separable data), and along directions that no
decision informs. The Newton step in standard errors distinguishes these
(`serd_core.ascent.newton_ascent`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import (
    AT_A_KINK,
    AT_MAXIMUM,
    AscentResult,
    Objective,
    Step,
    StepCallback,
)
from serd_core.ascent.newton_ascent import STILL, Curvature, NewtonAscent, NewtonStep
from serd_core.posterior.beliefs import Belief
from serd_core.posterior.coordinates import (
    Coordinates,
    LogPosterior,
    coordinates,
    described,
    free_in_use,
)
from serd_core.posterior.parameters import Parameters
from serd_core.posterior.posterior import Posterior

#: Distance from the maximum, in standard errors, at which the end of an ascent is left as it is.
CLOSE = 1e-3
#: Newton steps from the end of an ascent; from a maximum three suffice.
FINAL_STEPS = 20
#: Length of a Newton step, relative to the one before, from which steps have no end.
LASTING = 0.5
_NO_EFFECT = 1e-8
#: Relative error of second derivatives by differences of gradients.
_DIFFERENCES = 1e-6
#: Weights beyond, over the range of their feature, decide every choice.
_FAR = 1e4


@dataclass(frozen=True, eq=False)
class Certificate:
    """Where the ascent ends and what that is worth; undetermined: directions nothing determines."""

    parameters: Parameters
    ascended: AscentResult
    undetermined: tuple[str, ...] = ()


def certificate(
    posterior: Posterior,
    belief: Belief,
    parameters: Parameters,
    ascended: AscentResult,
    on_step: StepCallback | None = None,
) -> Certificate:
    """The end of the ascent, or the maximum nearby where that is not the same.

    Numbers on which nothing in the problem depends may be anything.

    on_step: called once where the fit moves on to that maximum. An ascent that did not converge, or
    ended at a kink, stays as it is. So do those of policies over optimal Q-values, whose log
    posterior has kinks. One that rounding ended, as with features of 1e6, is judged by Newton's
    method alone.
    """
    smooth = posterior.policy_model.equation.curved
    ended = ascended.converged or ascended.by_rounding
    if not (ended and smooth) or ascended.message == AT_A_KINK:
        return Certificate(parameters, ascended)
    space = coordinates(posterior.problem, belief, parameters)
    objective = LogPosterior(posterior, space)
    start = space.of(parameters)
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
            return Certificate(parameters, counted)
        mean, number = found.objective / posterior.observations.n_decisions, ascended.n_steps + 1
        if on_step is not None:
            vector = space.table @ found.vector
            on_step(Step(number, mean, ascended.gradient_norm, counted.n_evaluations, vector))
        trace = np.append(ascended.objective_trace, mean)
        return Certificate(
            space.parameters(found.vector), replace(counted, n_steps=number, objective_trace=trace)
        )
    reason = _reason(objective, found.vector, step, space.describe, "the log posterior")
    if not reason:
        reason = f"Newton step of {step.standard_errors:.2g} standard errors"
    flat = tuple(space.describe(each) for each in step.flat) if reason.startswith(_FLAT) else ()
    failed = replace(counted, converged=False, message=f"not converged: {reason}")
    return Certificate(parameters, failed, flat)


def weights_certificate(
    objective: Objective, names: Sequence[str], ascended: AscentResult
) -> tuple[AscentResult, tuple[str, ...]]:
    """The end of an ascent over weights alone, and the directions that nothing determines.

    objective: of weights (F,) in units of one over the ranges of their features. An ascent that
    ended where weights grow without end, or may be anything, did not converge. The second
    derivatives are differences of gradients.
    """

    def describe(direction: FloatArray) -> str:
        return described(direction, [f"reward {name}" for name in names])

    if not ascended.converged:
        if not np.max(np.abs(ascended.vector), initial=0.0) > _FAR:
            return ascended, ()
        reason = f"the objective grows on and on along {describe(ascended.vector)}"
        return replace(ascended, message=f"not converged: {reason}; give these numbers a prior"), ()
    values, vectors = np.linalg.eigh(-objective.hessian(ascended.vector))
    values[np.abs(values) <= _DIFFERENCES * np.max(np.abs(values), initial=0.0)] = 0.0
    step = Curvature(values, vectors).newton(objective.evaluate(ascended.vector)[1])
    reason = _reason(objective, ascended.vector, step, describe, "the objective")
    if not reason:
        return ascended, ()
    flat = tuple(map(describe, step.flat)) if reason.startswith(_FLAT) else ()
    return replace(ascended, converged=False, message=f"not converged: {reason}"), flat


_FLAT = "nothing determines"


def _reason(
    objective: Objective,
    at: FloatArray,
    step: NewtonStep,
    describe: Callable[[FloatArray], str],
    subject: str,
) -> str:
    """Why a point with a Newton step is no maximum; empty where the step does not show it."""
    if len(step.rising):
        bent = describe(step.rising[0])
        return f"{subject} bends up along {bent} (a saddle point); start elsewhere"
    if _grows_without_end(objective, at, step):
        return (
            f"{subject} grows on and on along {describe(step.move)} (separable decisions); give"
            " these numbers a prior"
        )
    if len(step.flat):
        return f"{_FLAT} {describe(step.flat[0])}; give these numbers a prior"
    return ""


def _grows_without_end(objective: Objective, at: FloatArray, step: NewtonStep) -> bool:
    """Whether a long Newton step leads to one as long and in the same direction.

    Near a maximum it would lead to a much shorter one.
    """
    length = float(np.linalg.norm(step.move))
    if not np.any(np.abs(step.move) > STILL):
        return False
    there = at + step.move
    curvature = Curvature(*np.linalg.eigh(-objective.hessian(there)))
    following = curvature.newton(objective.evaluate(there)[1])
    ahead = float(following.move @ step.move) / length
    return not len(following.rising) and ahead >= LASTING * length


def _with_effect(posterior: Posterior, space: Coordinates, directions: FloatArray) -> FloatArray:
    """(k, d) of the span of (n, d) directions, those that move numbers in use."""
    jacobian = space.belief.jacobian(space.like)
    in_use = free_in_use(posterior.problem, space.like, jacobian)
    units = space.units()
    moved = (directions @ (space.table / units[:, None]).T)[:, in_use]
    weights, sizes, _ = np.linalg.svd(moved, full_matrices=False)
    return np.asarray(weights[:, sizes > _NO_EFFECT].T @ directions)
