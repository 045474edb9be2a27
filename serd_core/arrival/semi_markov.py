"""Time of arrival of a semi-Markov chain: moves from state to state that take random times.

A move e from s to s' has the probability p_e and takes a dwell time of its class, independent of
all others. With time in steps of length d and f_e(j) the probability that the move takes j steps,
the arrival from s has the generating function

    G_s(z) = sum_e p_e f_e^(z) G_s'(z),    G_goal(z) = 1,    f^(z) = sum_j f(j) z^j

a linear system for each z, and its distribution follows from N values of z on a circle by the fast
Fourier transform (Howard, Dynamic Probabilistic Systems II, 1971; Abate and Whitt, Queueing Systems
10, 1992). On a circle of radius r < 1, arrivals after N steps or more add at most r^N to each
number.

The number of decisions, as in the thesis, is the case f(j) = 1[j = 1].
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from serd_core.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    bool_array,
    first_index,
    float_array,
    int_array,
    require_each,
    require_index,
)
from serd_core.arrival.absorption import probability_of_ever_arriving
from serd_core.arrival.chain import ArrivalByState, GoalProblem, goal_mask
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import transitions_of
from serd_core.errors import SerdError
from serd_core.mdp.mdp import checked_policy
from serd_core.memory import require_memory

#: r^N: what late arrivals may add to a probability; rounding is its inverse times that of a number.
ALIASED = 1e-8
#: Steps, doubled as often as needed, after which the law is constant where a later arrival has at
#: most this probability.
SOON, SETTLED = 512, 1e-4
_SUM_TOLERANCE = 1e-6
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
class DwellTimes:
    """mass: (C, J) probability that a move of each class takes 0, 1, ... J - 1 steps of step_s."""

    step_s: float
    mass: FloatArray

    def __post_init__(self) -> None:
        if not 0 < self.step_s < np.inf:
            raise SerdError(f"step_s must be above 0 and finite, got {self.step_s}; use 0.1")
        mass = float_array("mass", self.mass, (None, None))
        bad = first_index(~(mass >= 0) | (mass.sum(axis=1, keepdims=True) > 1 + _SUM_TOLERANCE))
        if bad is not None:
            raise SerdError(
                f"mass[{bad[0]}] must be probabilities with a sum of at most 1, got {mass[bad[0]]};"
                " normalise it (what is missing takes longer than the horizon)"
            )
        object.__setattr__(self, "mass", mass)


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

    def __post_init__(self) -> None:
        object.__setattr__(self, "goal", bool_array("goal", self.goal, (None,)))
        n_states, n_moves = len(self.goal), len(np.atleast_1d(self.state))
        for name in ("state", "successor", "dwell"):
            object.__setattr__(self, name, int_array(name, getattr(self, name), (n_moves,)))
        for name in ("state", "successor"):
            require_index(name, getattr(self, name), n_states, "a state")
        object.__setattr__(
            self, "probability", float_array("probability", self.probability, (n_moves,))
        )
        chances, fix = self.probability, "leave out moves that never happen"
        require_each("probability", chances, chances >= 0, "not be negative", fix)
        total = np.bincount(self.state, self.probability, minlength=n_states)
        if (wrong := first_index(~self.goal & (np.abs(total - 1) > _SUM_TOLERANCE))) is not None:
            raise SerdError(
                f"probability of the moves from state {wrong[0]} must sum to 1, got"
                f" {total[wrong[0]]}; normalise it"
            )

    def matrix(self, weights: FloatArray | ComplexArray) -> scipy.sparse.csc_array:
        """(S, S) sum of weights (E,) by state and successor."""
        shape = (len(self.goal), len(self.goal))
        return scipy.sparse.csc_array((weights, (self.state, self.successor)), shape=shape)


def renewal_chain(
    problem: GoalProblem,
    policy: FloatArray,
    outcome_probabilities: FloatArray,
    dwell: IntArray | None = None,
) -> RenewalChain:
    """The moves of an (S, A) policy under outcome models.

    dwell: (M, K) class of each outcome of each model; None for one class of all moves.
    """
    goal, mdp = goal_mask(problem), problem.mdp
    choice = checked_policy("policy", policy, mdp)
    filled = transitions_of(mdp.transitions, outcome_probabilities)
    model, classes = mdp.transitions, np.zeros(filled.model.n_entries, dtype=np.int64)
    if dwell is not None:
        if not isinstance(model, OutcomeModels):
            raise SerdError(
                f"dwell classes belong to the outcomes of OutcomeModels, got a"
                f" {type(model).__name__}; pass dwell=None, or build the RenewalChain"
            )
        table = int_array("dwell", dwell, (model.n_models, model.n_outcomes))
        classes = table.ravel()[model.local_index]
    return RenewalChain(
        state=model.row // mdp.n_actions,
        successor=model.successor,
        probability=filled.entries * choice.ravel()[model.row],
        dwell=classes,
        goal=goal,
    )


def semi_markov_arrival(chain: RenewalChain, dwell: DwellTimes, n_steps: int) -> ArrivalByState:
    """Probability of having arrived within 0, 1, ... n_steps steps from each state.

    It is constant after `SOON` steps, or twice as many and so on, where at most `SETTLED` arrive
    later from any state.
    """
    if n_steps < 0:
        raise SerdError(f"n_steps must not be negative, got {n_steps}; use the time-out's")
    require_index("dwell", chain.dwell, len(dwell.mass), "a class of dwell times")
    goal, size = chain.goal, n_steps + 1
    require_memory(
        f"arrival within {n_steps} steps from each of {len(goal)} states",
        _ARRAYS * 8.0 * size * len(goal),
        "take an earlier time-out, longer steps or larger cells",
    )
    ever = probability_of_ever_arriving(chain.matrix(chain.probability).tocsr(), goal)
    system, soon = _Equations(chain), min(size, SOON)
    cdf = _arrived(system, dwell, soon)
    while soon < size and np.any(ever - cdf[-1] > SETTLED):
        soon = min(2 * soon, size)
        cdf = _arrived(system, dwell, soon)
    cdf[:, goal] = 1.0
    later = np.broadcast_to(cdf[-1], (size - len(cdf), len(goal)))
    return ArrivalByState(np.maximum.accumulate(np.concatenate([cdf, later]), axis=0), ever)


def _arrived(system: "_Equations", dwell: DwellTimes, size: int) -> FloatArray:
    """(size, S) probability of having arrived within 0, 1, ... size - 1 steps."""
    radius = ALIASED ** (1.0 / size)
    powers = radius ** np.arange(size)
    damped = np.zeros((len(dwell.mass), size))
    # Dwell times beyond the horizon do not arrive within it.
    kept = min(size, dwell.mass.shape[1])
    damped[:, :kept] = dwell.mass[:, :kept] * powers[:kept]
    transformed = np.fft.rfft(damped, axis=1)
    generating = np.stack([system.solve(values) for values in transformed.T])
    steps = np.fft.irfft(generating, n=size, axis=0) / powers[:, None]
    return np.asarray(np.clip(np.cumsum(steps, axis=0), 0.0, 1.0))


class _Equations:
    """The linear system of G at one z after another; its pattern is set up once."""

    def __init__(self, chain: RenewalChain) -> None:
        self._chain = chain
        self._moving = _in_order_of_elimination(chain, np.flatnonzero(~chain.goal))
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
        size = len(self._moving)
        if size:
            entries = np.concatenate([np.ones(size), -weights[self._onward]])
            self._matrix.data = _complex_counts(self._place, entries, len(self._matrix.data))
            arriving = _complex_counts(self._row, weights[self._arriving], size)
            try:
                factor = splu(self._matrix, **_AS_ORDERED)
            except RuntimeError:
                raise SerdError(
                    "moves of the chain must take time, got a loop that is certain and takes 0"
                    " steps; give its dwell times a mass of 0 at step 0"
                ) from None
            found[self._moving] = factor.solve(arriving)
        return found


def _in_order_of_elimination(chain: RenewalChain, moving: IntArray) -> IntArray:
    """The states in an order that fills the factor little, found once for all z."""
    if not len(moving):
        return moving
    onward = chain.matrix(chain.probability)[:, moving][moving, :]
    stays = scipy.sparse.csc_array(scipy.sparse.identity(len(moving)))
    factor = splu((stays - 0.5 * onward).tocsc())
    return moving[np.argsort(factor.perm_c)]


def _complex_counts(index: IntArray, weights: ComplexArray, size: int) -> ComplexArray:
    """(size,) sums of complex weights by index."""
    found = np.empty(size, dtype=np.complex128)
    found.real = np.bincount(index, weights.real, minlength=size)
    found.imag = np.bincount(index, weights.imag, minlength=size)
    return found
