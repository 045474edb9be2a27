"""When a goal is reached by decisions that take time: the chain of a policy with its dwell times.

A decision of (s, a) with the outcome k takes a time of the law of its local model at the pace of
the state, or a known time where it stays. So the time of arrival is the sum of independent times
along the chain of the policy (`serd_core.arrival.semi_markov`). The number of decisions, whose law
the thesis predicts (Fig. 5.10), is the case in which every decision takes one step
(`serd_core.arrival.chain`).
"""

import numpy as np
from scipy.special import gammainc

from serd_core.arrays import FloatArray
from serd_core.arrival.chain import ArrivalByState, GoalProblem
from serd_core.arrival.semi_markov import DwellTimes, renewal_chain, semi_markov_arrival
from serd_core.semi_markov.models import require_timed


def timed_arrival(
    problem: GoalProblem,
    policy: FloatArray,
    parameters: FloatArray,
    step_s: float,
    n_steps: int,
) -> ArrivalByState:
    """Probability of having arrived within 0, 1, ... n_steps steps of step_s from each state.

    policy: (S, A); parameters: (N,) of the dynamics. SerdError where moves take no time.

        arrival = sc.timed_arrival(timed, policy.probabilities, fit.parameters.truth, 0.2, 300)
    """
    laws = require_timed(problem.mdp.transitions).laws(parameters)
    pairs = np.stack([laws.mean_s, laws.shape], axis=2).reshape(-1, 2)
    distinct, place = np.unique(pairs, axis=0, return_inverse=True)
    classes = place.reshape(laws.mean_s.shape)
    mass = dwell_steps(distinct[:, 0], distinct[:, 1], step_s, n_steps)
    chain = renewal_chain(problem, policy, laws.probability, classes)
    return semi_markov_arrival(chain, DwellTimes(step_s, mass), n_steps)


def dwell_steps(mean_s: FloatArray, shape: FloatArray, step_s: float, n_steps: int) -> FloatArray:
    """(C, n_steps + 1) probability of times that take 0, 1, ... steps, rounded to the nearest.

    mean_s, shape: (C,) of gamma laws; a shape of inf is a time that does not vary. A time takes one
    step at least.
    """
    mass = np.zeros((len(mean_s), n_steps + 1))
    given = np.flatnonzero(np.isinf(shape))
    steps = np.maximum(np.rint(mean_s[given] / step_s).astype(np.int64), 1)
    within = steps <= n_steps
    mass[given[within], steps[within]] = 1.0
    law = np.flatnonzero(np.isfinite(shape))
    ends_s = step_s * (np.arange(1, n_steps + 1) + 0.5)
    below = gammainc(shape[law, None], ends_s * (shape / mean_s)[law, None])
    mass[law, 1:] = np.diff(below, prepend=0.0, axis=1)
    return mass
