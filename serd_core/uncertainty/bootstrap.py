"""Bootstrap over episodes: errors and intervals of whatever is estimated from decisions.

Episodes are drawn with replacement, as decisions within one depend on each other (Efron and
Tibshirani, An Introduction to the Bootstrap, 1993). An estimate that learns the dynamics anew from
each sample has their uncertainty in its errors.

    found = bootstrap(decisions, lambda d: fit_mdce_serd(problem, d).reward_weights, rng=rng)
    found.standard_errors, found.interval(0.95)
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from serd_core.arrays import (
    FloatArray,
    IntArray,
    first_index,
    number_array,
    require_generator,
    require_share,
)
from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """estimates: (n, ...) of the resampled decisions."""

    estimates: FloatArray

    @property
    def standard_errors(self) -> FloatArray:
        """Standard deviation of the estimates."""
        return np.asarray(self.estimates.std(axis=0, ddof=1))

    def interval(self, coverage: float = 0.95) -> tuple[FloatArray, FloatArray]:
        """Lower and upper end of the percentile intervals."""
        require_share("coverage", coverage)
        tails = np.array([(1.0 - coverage) / 2.0, (1.0 + coverage) / 2.0])
        low, high = np.quantile(self.estimates, tails, axis=0)
        return low, high


def bootstrap(
    decisions: Decisions,
    estimate: Callable[[Decisions], FloatArray],
    *,
    rng: np.random.Generator,
    n: int = 200,
) -> Bootstrap:
    """Estimates from n samples of as many episodes as there are, drawn with replacement.

    SerdError where one is NaN.
    """
    require_generator(rng)
    episodes = decisions.episodes
    if n < 2 or len(episodes) < 2:
        raise SerdError(
            f"bootstrap must have at least 2 samples and 2 episodes, got {n} and {len(episodes)}"
        )
    order = np.argsort(decisions.episode, kind="stable")
    rows = np.split(order, np.flatnonzero(np.diff(decisions.episode[order])) + 1)
    drawn = rng.integers(len(episodes), size=(n, len(episodes)))
    estimates = [estimate(_sample(decisions, rows, each)) for each in drawn]
    found = np.asarray(number_array("what estimate returns", estimates), dtype=np.float64)
    if (bad := first_index(np.isnan(found))) is not None:
        raise SerdError(
            f"estimate must return numbers for every sample, got NaN for sample {bad[0]} of {n};"
            " estimate what every sample of the episodes determines"
        )
    return Bootstrap(found)


def _sample(decisions: Decisions, rows: list[IntArray], drawn: IntArray) -> Decisions:
    """The drawn episodes, numbered anew, so that one drawn twice is two."""
    chosen = [rows[place] for place in drawn]
    episode = np.repeat(np.arange(len(chosen)), [len(each) for each in chosen])
    return replace(decisions.select(np.concatenate(chosen)), episode=episode)
