"""Where a policy spends its time: expected, discounted visits.

    d(s) = sum_t gamma^t P(s_t = s) = P(s_0 = s) + gamma sum_{s',a} P(s | s', a) pi(a | s') d(s')

The sum over all states is 1 / (1 - gamma). Feature expectations are sums over it (3.7).
"""

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.dynamics.transitions import Transitions
from serd_core.linear.automatic import Automatic
from serd_core.mdp.distributions import checked_distribution, checked_policy
from serd_core.mdp.mdp import Mdp


def state_action_occupancy(
    mdp: Mdp, transitions: Transitions, policy: FloatArray, starts: FloatArray
) -> FloatArray:
    """(S, A) expected discounted visits of an (S, A) policy from the (S,) start distribution."""
    choice = checked_policy("policy", policy, mdp)
    begin = checked_distribution("starts", starts, mdp.n_states)
    data = mdp.policy_pattern.system_data(choice, transitions.entries, mdp.discount)
    system = Automatic().prepare(mdp.policy_pattern, data)
    return np.asarray(system.solve_transposed(begin)[:, None] * choice)
