"""Several starts, and how many distinct explanations they found (section 4.1).

Rewards and dynamics together can often explain the same demonstrations in more than one way. Fits
that ended in the same place are one explanation; places are compared by outcome probabilities and
by reward weights per temperature, so neither the softmax gauge nor the scale that policy matching
leaves open (`fit_pm_serd`) makes a difference. A fit that did not converge is on its way to one of
them and explains nothing; it is kept and counted apart.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.cluster.hierarchy

from serd_core.arrays import FloatArray, IntArray
from serd_core.checks import require_count, require_generator
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult


@dataclass(frozen=True, eq=False)
class Explanation:
    """One optimum: its best fit and the numbers of the starts whose fits converged there."""

    fit: FitResult
    starts: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class MultiStart:
    """All fits by start, and the distinct explanations among those that converged, best first."""

    fits: tuple[FitResult, ...]
    explanations: tuple[Explanation, ...]

    @property
    def best(self) -> FitResult:
        """The converged fit with the highest objective; SerdError where none converged."""
        if not self.explanations:
            raise SerdError(
                f"at least one of {len(self.fits)} fits must have converged, got none, the first"
                f" with {self.fits[0].message!r}; give the ascent more steps"
            )
        return self.explanations[0].fit

    @property
    def n_converged(self) -> int:
        """How many of the fits converged."""
        return len(self.fits) - len(self.unconverged)

    @property
    def unconverged(self) -> tuple[int, ...]:
        """Numbers of the starts whose fits did not converge, and so belong to no explanation."""
        return tuple(start for start, fit in enumerate(self.fits) if not fit.converged)


def multi_start(
    fit: Callable[[np.random.Generator], FitResult],
    n_starts: int,
    rng: np.random.Generator,
    *,
    tolerance: float = 0.05,
) -> MultiStart:
    """Run `fit` with independent generators and group the results.

    tolerance: distance up to which two fits are the same explanation; probabilities count as they
    are and reward weights relative to their size.
    """
    require_count("n_starts", n_starts, 1, "12")
    require_generator(rng)
    fits = tuple(fit(generator) for generator in rng.spawn(n_starts))
    starts = np.flatnonzero([one.converged for one in fits])
    labels = _labels([signature(fits[start]) for start in starts], tolerance)
    groups = [starts[labels == label] for label in np.unique(labels)]
    explanations = [_explanation(fits, members) for members in groups]
    explanations.sort(key=lambda found: -found.fit.objective)
    return MultiStart(fits=fits, explanations=tuple(explanations))


def signature(fit: FitResult) -> FloatArray:
    """(n,) what fits are compared by; weights are squashed so that huge ones are alike."""
    # The policy depends on reward weights per temperature.
    weights = np.arcsinh(fit.reward_weights / fit.temperature)
    belief, truth = fit.believed_outcome_probabilities, fit.outcome_probabilities
    return np.concatenate([weights, belief.ravel(), truth.ravel()])


def _labels(signatures: list[FloatArray], tolerance: float) -> FloatArray:
    if len(signatures) < 2:
        return np.ones(len(signatures))
    tree = scipy.cluster.hierarchy.linkage(
        np.stack(signatures), method="complete", metric="chebyshev"
    )
    labels: FloatArray = scipy.cluster.hierarchy.fcluster(tree, tolerance, criterion="distance")
    return labels


def _explanation(fits: tuple[FitResult, ...], members: IntArray) -> Explanation:
    starts = tuple(int(member) for member in members)
    best = max(starts, key=lambda start: fits[start].objective)
    return Explanation(fit=fits[best], starts=starts)
