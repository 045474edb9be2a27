"""Selection of a prior's weight lambda on validation data (Fig. 5.8)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from serd_core.arrays import BoolArray, FloatArray, first_index, float_array
from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult


@dataclass(frozen=True, eq=False)
class WeightSelection:
    """weights, scores: (n,); fits: one per weight; best: index of the highest score.

    Scores include those of fits that did not converge; see `converged`.
    """

    weights: FloatArray
    scores: FloatArray
    fits: tuple[FitResult, ...]
    best: int

    @property
    def weight(self) -> float:
        """The selected weight."""
        return float(self.weights[self.best])

    @property
    def fit(self) -> FitResult:
        """Its fit."""
        return self.fits[self.best]

    @property
    def converged(self) -> BoolArray:
        """(n,) whether each fit converged."""
        return np.array([fit.converged for fit in self.fits], dtype=np.bool_)


def select_weight(
    fit: Callable[[float], FitResult], score: Callable[[FitResult], float], weights: Sequence[float]
) -> WeightSelection:
    """Fit with every weight and keep the one with the highest score (the larger of equals).

    fit: weight to fit on training data; score: fit to its validation log-likelihood.
    """
    candidates = np.sort(float_array("weights", weights, (None,)))
    if not candidates.size:
        raise SerdError("weights must hold at least one candidate, got none")
    fits = tuple(fit(float(weight)) for weight in candidates)
    scores = np.array([score(one) for one in fits])
    if (bad := first_index(np.isnan(scores))) is not None:
        raise SerdError(
            f"score of weight {candidates[bad]} must be a number, got {scores[bad]};"
            " score the fit on validation data"
        )
    best = len(scores) - 1 - int(np.argmax(scores[::-1]))
    return WeightSelection(weights=candidates, scores=scores, fits=fits, best=best)


def split_episodes(
    decisions: Decisions, validation_share: float, rng: np.random.Generator
) -> tuple[Decisions, Decisions]:
    """Training and validation decisions, split by whole episodes; both get at least one."""
    episodes = decisions.episodes
    if len(episodes) < 2:
        raise SerdError(
            f"decisions must have at least two episodes to be split, got {len(episodes)}"
        )
    if not 0.0 < validation_share < 1.0:
        raise SerdError(f"validation_share must be between 0 and 1, got {validation_share}")
    n_validation = int(np.clip(round(validation_share * len(episodes)), 1, len(episodes) - 1))
    shuffled = rng.permutation(episodes)
    return (
        decisions.select_episodes(shuffled[n_validation:]),
        decisions.select_episodes(shuffled[:n_validation]),
    )
