"""Log-likelihood of observed transitions: sum n(s, a, s') log P(s' | s, a).

Where several outcomes land in s', their probabilities add up; none of them is guessed.
"""

import numpy as np

from serd_core.arrays import FloatArray, floored, weighted_counts
from serd_core.demonstrations.observations import Observations
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp


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


def require_possible(observations: Observations, mdp: Mdp, local_probabilities: FloatArray) -> None:
    """SerdError naming the first observed transition of probability 0: nothing makes it likely."""
    model = mdp.transitions
    found = model.groups.probabilities(model.entries(local_probabilities))[observations.group]
    impossible = observations.group[found <= 0]
    if impossible.size:
        state, action = divmod(int(model.groups.row[impossible[0]]), mdp.n_actions)
        raise SerdError(
            f"dynamics must explain every decision, but rule out the observed step from state"
            f" {state} by action {action} to state {model.groups.successor[impossible[0]]}; give"
            " it a positive probability or drop such decisions"
        )
