"""Likelihood of moves whose action is hidden, by the expected counts of their actions.

    L = sum m(s, s') log Z(s, s'),    Z(s, s') = sum_a pi(a | s) P(s' | s, a)

With q(a | s, s') = pi(a | s) P(s' | s, a) / Z, the probability of each action given the move,

    dL  = sum m E_q[d log pi + d log P]
    d2L = sum m E_q[d2 log pi + d2 log P] + sum m Cov_q[d log pi + d log P]

(Fisher, Louis 1982). So gradient and Hessian are those of decisions with their action at the
expected counts m q, and the Hessian has one more term.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse

from serd_core.arrays import FloatArray, floored, weighted_counts
from serd_core.demonstrations.observations import Observations
from serd_core.dynamics.transition_model import Transitions


@dataclass(frozen=True, eq=False)
class ExpectedCounts:
    """Observations in which expected counts stand for hidden actions.

    observations: with `state_action` and `group_count` of shown and of hidden actions.
    share: (H,) q of each transition that explains a hidden action; log_moves: (T,) log Z;
    log_likelihood: L.
    """

    observations: Observations
    share: FloatArray
    log_moves: FloatArray
    log_likelihood: float


def expected_counts(
    seen: Observations, log_policy: FloatArray, true: Transitions
) -> ExpectedCounts:
    """Share hidden actions for an (S, A) log policy and P."""
    hidden = seen.hidden
    if not hidden:
        return ExpectedCounts(seen, np.zeros(0), np.zeros(0), 0.0)
    row = seen.key[hidden.place] // true.model.n_states
    probability = seen.probabilities(true.local_probabilities)
    log_joint = log_policy.ravel()[row] + np.log(floored(probability[hidden.place]))
    largest = np.full(len(hidden.count), -np.inf)
    np.maximum.at(largest, hidden.move, log_joint)
    share = np.exp(log_joint - largest[hidden.move])
    total = weighted_counts(hidden.move, share, len(hidden.count))
    share /= total[hidden.move]
    completed = _completed(seen, hidden.count[hidden.move] * share)
    log_moves = largest + np.log(total)
    return ExpectedCounts(completed, share, log_moves, float(hidden.count @ log_moves))


def drawn_actions(
    seen: Observations, log_policy: FloatArray, true: Transitions, rng: np.random.Generator
) -> Observations:
    """Observations with a draw of the hidden actions, for an (S, A) log policy and P."""
    share, hidden = expected_counts(seen, log_policy, true).share, seen.hidden
    n_states, n_actions = seen.state_action.shape
    action = seen.key[hidden.place] // n_states % n_actions
    shares = np.zeros((len(hidden.count), n_actions))
    shares[hidden.move, action] = share
    drawn = rng.multinomial(hidden.count.astype(np.int64), shares)
    return _completed(seen, drawn[hidden.move, action])


def _completed(seen: Observations, counts: FloatArray) -> Observations:
    """Observations with (H,) counts of the transitions that explain hidden actions."""
    place = seen.hidden.place
    by_pair = weighted_counts(
        seen.key[place] // len(seen.state_action), counts, seen.state_action.size
    )
    return replace(
        seen,
        state_action=seen.state_action + by_pair.reshape(seen.state_action.shape),
        group_count=seen.group_count + weighted_counts(place, counts, len(seen.key)),
    )


def move_scores(found: ExpectedCounts, scores: FloatArray) -> FloatArray:
    """(T, n) score of each hidden move, E_q of the (G, n) scores of the transitions `key`."""
    hidden = found.observations.hidden
    shape = len(hidden.count), len(scores)
    table = scipy.sparse.csr_array((found.share, (hidden.move, hidden.place)), shape=shape)
    return np.asarray(table @ scores)


def covariance_of_scores(found: ExpectedCounts, scores: FloatArray) -> FloatArray:
    """(n, n) sum m Cov_q of the (G, n) scores of the transitions `key`."""
    hidden = found.observations.hidden
    centred = scores[hidden.place] - move_scores(found, scores)[hidden.move]
    weights = hidden.count[hidden.move] * found.share
    return np.asarray((centred * weights[:, None]).T @ centred)
