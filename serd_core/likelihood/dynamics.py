"""Log-likelihood of observed transitions: sum n(s, a, s') log P(s' | s, a).

Where several outcomes land in s', their probabilities add up; none of them is guessed.
"""

import numpy as np

from serd_core.arrays import FloatArray, floored, weighted_counts
from serd_core.likelihood.observations import Observations


def dynamics_log_likelihood(
    observations: Observations, entries: FloatArray
) -> tuple[float, FloatArray]:
    """Value and (E,) gradient by the entries of P."""
    probability = floored(
        weighted_counts(
            observations.entry_group, entries[observations.entry], len(observations.group)
        )
    )
    value = float(np.sum(observations.group_count * np.log(probability)))
    gradient = np.zeros_like(entries)
    ratio = observations.group_count / probability
    gradient[observations.entry] = ratio[observations.entry_group]
    return value, gradient
