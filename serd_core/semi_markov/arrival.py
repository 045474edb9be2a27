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
    """(C, n_steps + 1) probability of times that take 0, 1, ... steps.

    mean_s, shape: (C,) of gamma laws; a shape of inf is a time that does not vary. A time between
    two steps is divided between them so that the mean stays what it is. So the probability of step
    i is the second difference, over step_s, of the integral of the law's distribution function.
    """
    shape, mean_s = shape[:, None], mean_s[:, None]
    ends_s = step_s * np.arange(n_steps + 2)
    with np.errstate(invalid="ignore"):  # of shapes of inf, which are replaced
        rate = shape / mean_s * ends_s
        integral = ends_s * gammainc(shape, rate) - mean_s * gammainc(shape + 1.0, rate)
    integral = np.where(np.isinf(shape), np.maximum(ends_s - mean_s, 0.0), integral)
    mass = np.diff(integral, n=2, prepend=0.0, axis=1) / step_s
    return np.asarray(mass.clip(0.0, 1.0))
