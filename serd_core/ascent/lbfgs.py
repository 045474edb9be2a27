"""Limited-memory BFGS of scipy.optimize, stopped by the gradient and nothing weaker."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.optimize

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import OUT_OF_STEPS, Ascent, Climb, vanishing


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
        for _ in range(2):
            reason = minimise(
                climb,
                climb.here.vector,
                self._accept,
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

    def _accept(self, climb: Climb, vector: FloatArray) -> None:
        point = climb.evaluate(vector)
        climb.accept(point, *vanishing(point, self.gradient_tolerance))


LBFGS = Lbfgs()


def minimise(
    climb: Climb,
    start: FloatArray,
    accept: Callable[[Climb, FloatArray], None],
    bounds: list[tuple[float, float]] | None = None,
    **options: Any,
) -> str:
    """Why L-BFGS-B of SciPy ended, which gives `accept` the vector of each step."""

    def negated(vector: FloatArray) -> tuple[float, FloatArray]:
        point = climb.evaluate(vector)
        return -point.value, -point.gradient

    def after_step(intermediate_result: scipy.optimize.OptimizeResult) -> None:
        accept(climb, np.asarray(intermediate_result.x))
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
