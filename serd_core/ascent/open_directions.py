"""Directions along which an objective has no maximum, as it is flat or grows without end.

Gradients vanish along both: where all decisions agree (separable data), or no demonstration has a
feature, the objective grows by less and less with the weights. A direction is open where the
objective is nowhere lower than at the point, one way, and does not fall any more far away, as a
weak prior would make it. It is looked for among directions of hardly any curvature, the Newton
step, and the way from the origin. Numbers must be of comparable scale.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import STOPPED, AscentResult, Objective
from serd_core.errors import SerdError

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
) -> tuple[AscentResult, tuple[str, ...]]:
    """The end of an ascent over weights, and directions that nothing determines, in words."""
    near = ended.converged or ended.by_rounding or ended.gradient_norm <= VANISHING
    if ended.message == STOPPED or not near:
        return ended, ()
    describe = partial(described, names=names)
    found = open_directions(objective, ended.vector / scale)
    return found.judge(ended, describe, fix), tuple(map(describe, found.flat))


def described(parts: FloatArray, names: Sequence[str], share: float = 0.25) -> str:
    """What moves along a direction (n,), as shares of the largest, largest first."""
    parts = parts / np.max(np.abs(parts))
    order = np.argsort(-np.abs(parts), kind="stable")
    order = order[np.abs(parts[order]) >= share]
    return ", ".join(f"{parts[i]:+.2f} {names[i]}" for i in order[:6])


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
