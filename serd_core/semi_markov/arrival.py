"""When a goal is reached: the chain of a policy, whose moves take random times.

A move e from s to s' has the probability p_e and takes a time of its class, independent of all
others. With time in steps and f_e(j) the probability that the move takes j steps, the arrival from
s has the generating function

    G_s(z) = sum_e p_e f_e^(z) G_s'(z),    G_goal(z) = 1,    f^(z) = sum_j f(j) z^j

a linear system for each z, and its distribution follows from N values of z on a circle by the fast
Fourier transform (Howard, Dynamic Probabilistic Systems II, 1971; Abate and Whitt, Queueing Systems
10, 1992). On a circle of radius r < 1, arrivals after N steps or more add at most r^N to each
number.

A decision of (s, a) with the outcome k takes a time of the law of its local model at the pace of
the state, or a known time where it stays. The number of decisions, whose law the thesis predicts
(Fig. 5.10), is the case in which every decision takes one step.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu
from scipy.special import gammainc

from serd_core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    float_array,
    require_count,
    require_memory,
    require_positive,
)
from serd_core.arrival.chain import (
    ArrivalByState,
    GoalProblem,
    goal_mask,
    probability_of_ever_arriving,
)
from serd_core.mdp.mdp import checked_policy
from serd_core.semi_markov.models import SemiMarkovModels

#: r^N: what late arrivals may add to a probability; rounding is its inverse times that of a number.
ALIASED = 1e-8
#: Steps, doubled as often as needed, after which the law is constant where a later arrival has at
#: most this probability.
SOON, SETTLED = 512, 1e-4
#: Numbers per step and state that are held at once.
_ARRAYS = 4
#: Of matrices in order; pivots on the diagonal, which is at least the sum of the row's others.
_AS_ORDERED: dict[str, Any] = {
    "permc_spec": "NATURAL",
    "diag_pivot_thresh": 0.0,
    "options": {"SymmetricMode": True},
}
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class RenewalChain:
    """E moves: state, successor (E,); probability (E,) given the state; dwell (E,) class of each.

    goal: (S,) mask of the states that count as arrived; their moves are ignored.
    """

    state: IntArray
    successor: IntArray
    probability: FloatArray
    dwell: IntArray
    goal: BoolArray

    def matrix(self) -> scipy.sparse.csc_array:
        """(S, S) probabilities by state and successor."""
        shape, places = (len(self.goal), len(self.goal)), (self.state, self.successor)
        return scipy.sparse.csc_array((self.probability, places), shape=shape)


def timed_arrival(
    problem: GoalProblem, policy: FloatArray, parameters: FloatArray, step_s: float, n_steps: int
) -> ArrivalByState:
    """Probability of having arrived within 0, 1, ... n_steps steps of step_s from each state.

    policy: (S, A); parameters: (N,) of the dynamics, (0,) of known transitions. Where decisions
    have no dwell times (`semi_markov_problem`), each takes one step. The law is constant after
    `SOON` steps, or twice as many and so on, where at most `SETTLED` arrive later from any state.

        arrival = sc.timed_arrival(timed, policy.probabilities, fit.parameters.truth, 0.2, 300)
    """
    goal, mdp = goal_mask(problem), problem.mdp
    choice, model = checked_policy("policy", policy, mdp), mdp.transitions
    require_positive("step_s", step_s, "use 0.1")
    require_count("n_steps", n_steps, 0, "the time-out's")
    theta = float_array("parameters", parameters, (model.n_parameters,))
    if isinstance(model, SemiMarkovModels):
        laws = model.laws(theta)
        pairs = np.stack([laws.mean_s, laws.shape], axis=2).reshape(-1, 2)
        distinct, place = np.unique(pairs, axis=0, return_inverse=True)
        classes, table = place.reshape(-1)[model.local_index], laws.probability
        mass = dwell_steps(distinct[:, 0], distinct[:, 1], step_s, n_steps)
    else:
        classes, table = np.zeros(model.n_entries, dtype=np.int64), model.local_probabilities(theta)
        mass = np.array([[0.0, 1.0]])
    chain = RenewalChain(
        state=model.row // mdp.n_actions,
        successor=model.successor,
        probability=model.entries(table) * choice.ravel()[model.row],
        dwell=classes,
        goal=goal,
    )
    return renewal_arrival(chain, mass, n_steps)


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


def renewal_arrival(chain: RenewalChain, mass: FloatArray, n_steps: int) -> ArrivalByState:
    """The arrival by a chain; moves of class c take j steps with the probability mass[c, j]."""
    size = n_steps + 1
    require_memory(
        f"arrival within {n_steps} steps from each of {len(chain.goal)} states",
        _ARRAYS * 8.0 * size * len(chain.goal),
        "take an earlier time-out, longer steps or larger cells",
    )
    ever = probability_of_ever_arriving(chain.matrix().tocsr(), chain.goal)
    system, soon = _Equations(chain), min(size, SOON)
    cdf = _arrived(system, mass, soon)
    while soon < size and np.any(ever - cdf[-1] > SETTLED):
        soon = min(2 * soon, size)
        cdf = _arrived(system, mass, soon)
    cdf[:, chain.goal] = 1.0
    later = np.broadcast_to(cdf[-1], (size - len(cdf), len(chain.goal)))
    return ArrivalByState(np.maximum.accumulate(np.concatenate([cdf, later]), axis=0), ever)


def _arrived(system: "_Equations", mass: FloatArray, size: int) -> FloatArray:
    """(size, S) probability of having arrived within 0, 1, ... size - 1 steps."""
    powers = (ALIASED ** (1.0 / size)) ** np.arange(size)
    damped = np.zeros((len(mass), size))
    # Dwell times beyond the horizon do not arrive within it.
    kept = min(size, mass.shape[1])
    damped[:, :kept] = mass[:, :kept] * powers[:kept]
    transformed = np.fft.rfft(damped, axis=1)
    generating = np.stack([system.solve(values) for values in transformed.T])
    steps = np.fft.irfft(generating, n=size, axis=0) / powers[:, None]
    return np.asarray(np.clip(np.cumsum(steps, axis=0), 0.0, 1.0))


class _Equations:
    """The linear system of G at one z after another; its pattern is set up once."""

    def __init__(self, chain: RenewalChain) -> None:
        self._chain = chain
        self._moving = _in_order_of_elimination(chain)
        number = np.full(len(chain.goal), -1)
        number[self._moving] = np.arange(len(self._moving))
        size, row, column = len(self._moving), number[chain.state], number[chain.successor]
        self._arriving = np.flatnonzero((row >= 0) & (column < 0))
        self._onward = np.flatnonzero((row >= 0) & (column >= 0))
        self._row = row[self._arriving]
        diagonal = np.arange(size) * (size + 1)
        keys = np.concatenate([diagonal, column[self._onward] * size + row[self._onward]])
        distinct, self._place = np.unique(keys, return_inverse=True)
        starts = np.searchsorted(distinct, np.arange(size + 1) * size)
        self._matrix = scipy.sparse.csc_array(
            (np.ones(len(distinct), np.complex128), distinct % max(size, 1), starts),
            shape=(size, size),
        )

    def solve(self, values: ComplexArray) -> ComplexArray:
        """(S,) G at the z at which the classes have the values (C,) of f^."""
        weights = self._chain.probability * values[self._chain.dwell]
        found = np.ones(len(self._chain.goal), dtype=np.complex128)
        if size := len(self._moving):
            entries = np.concatenate([np.ones(size), -weights[self._onward]])
            self._matrix.data = _complex_counts(self._place, entries, len(self._matrix.data))
            arriving = _complex_counts(self._row, weights[self._arriving], size)
            found[self._moving] = splu(self._matrix, **_AS_ORDERED).solve(arriving)
        return found


def _in_order_of_elimination(chain: RenewalChain) -> IntArray:
    """The states that are no goal, in an order that fills the factor little for all z."""
    moving = np.flatnonzero(~chain.goal)
    if not len(moving):
        return moving
    stays = scipy.sparse.csc_array(scipy.sparse.identity(len(moving)))
    factor = splu((stays - 0.5 * chain.matrix()[:, moving][moving, :]).tocsc())
    return moving[np.argsort(factor.perm_c)]


def _complex_counts(index: IntArray, weights: ComplexArray, size: int) -> ComplexArray:
    """(size,) sums of complex weights by index."""
    found = np.empty(size, dtype=np.complex128)
    found.real = np.bincount(index, weights.real, minlength=size)
    found.imag = np.bincount(index, weights.imag, minlength=size)
    return found
