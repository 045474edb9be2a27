"""Counts of demonstrations per unit: the expert, or the episode where experts are not known.

All decisions of a unit are of one latent type. The log-likelihood of unit u under one type is

    l_u = sum n_u(s, a) log pi(a | s) + sum n_u(s, a, s') log P(s' | s, a)
          + sum m_u(s, s') log Z(s, s')

with the counts of `serd_core.demonstrations.observations`, taken per unit.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse

from serd_core.arrays import FloatArray, IntArray, floored, int_array
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import Observations, observe, taken_transitions
from serd_core.dynamics.transition_model import Transitions
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.posterior.hidden_actions import expected_counts


@dataclass(frozen=True, eq=False)
class Units:
    """Sufficient statistics of U units.

    labels: (U,) ascending; pooled: of all units together. choices: (U, S A), transitions: (U, G)
    and moves: (U, T) count what `Observations` has as `state_action`, `group` and `hidden`.
    n_episodes: (U,) of each unit.
    """

    labels: IntArray
    pooled: Observations
    choices: scipy.sparse.csr_array
    transitions: scipy.sparse.csr_array
    moves: scipy.sparse.csr_array
    n_episodes: FloatArray

    def weighted(self, weights: FloatArray) -> Observations:
        """The observations in which unit u counts `weights[u]` times."""
        pooled = self.pooled
        return replace(
            pooled,
            state_action=(weights @ self.choices).reshape(pooled.state_action.shape),
            group_count=np.asarray(weights @ self.transitions),
            hidden=replace(pooled.hidden, count=np.asarray(weights @ self.moves)),
        )

    def log_likelihoods(self, log_policy: FloatArray, true: Transitions) -> FloatArray:
        """(U,) l_u for an (S, A) log policy and P."""
        probability = self.pooled.probabilities(true.local_probabilities)
        found = self.choices @ log_policy.ravel() + self.transitions @ np.log(floored(probability))
        if self.pooled.hidden:
            hidden = expected_counts(self.pooled, log_policy, true)
            found = found + self.moves @ hidden.log_moves
        return np.asarray(found)


def units_of(mdp: Mdp, decisions: Decisions, experts: IntArray | None = None) -> Units:
    """Count by unit; experts: (N,) who took each decision, None for each episode as a unit."""
    given = decisions.episode if experts is None else experts
    labels, unit = np.unique(int_array("experts", given, (len(decisions),)), return_inverse=True)
    episodes, owners = np.unique(np.stack([decisions.episode, labels[unit]]), axis=1)
    if (twice := np.flatnonzero(np.diff(episodes) == 0)).size:
        raise SerdError(
            f"experts must be one per episode, got {owners[twice[0]]} and {owners[twice[0] + 1]} in"
            f" episode {episodes[twice[0]]}; number the experts by episode"
        )
    pooled = observe(mdp, decisions)
    shown, hidden = np.flatnonzero(~decisions.hidden), np.flatnonzero(decisions.hidden)
    taken = taken_transitions(mdp, decisions)[shown]
    pairs = np.stack([decisions.state[hidden], decisions.next_state[hidden]], axis=1)
    moves = np.unique(pairs, axis=0, return_inverse=True)[1].reshape(-1)

    def table(rows: IntArray, place: IntArray, size: int) -> scipy.sparse.csr_array:
        ones, shape = np.ones(len(rows)), (len(labels), size)
        return scipy.sparse.csr_array((ones, (unit[rows], place)), shape=shape)

    chosen = decisions.state[shown] * mdp.n_actions + decisions.action[shown]
    return Units(
        labels=labels.astype(np.int64),
        pooled=pooled,
        choices=table(shown, chosen, pooled.state_action.size),
        transitions=table(shown, np.searchsorted(pooled.key, taken), len(pooled.key)),
        moves=table(hidden, moves, len(pooled.hidden.count)),
        n_episodes=np.unique(owners, return_counts=True)[1].astype(np.float64),
    )
