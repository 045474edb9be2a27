"""The absorbing chain of a policy, and the arrival from each of its states (Fig. 5.10).

The probability of ever arriving is the least solution of h = P h, h = 1 at a goal, by elimination
without subtractions (Grassmann, Taksar and Heyman, Operations Research 33, 1985): a state's exit
rate is the sum of its ways out, never 1 - p(s|s), which cancels to nothing once leaving is rarer
than machine precision. It works on logarithms; what is certain is found by search.

A move e from s to s' has the probability p_e and takes j steps of time with the probability f_e(j).
So the arrival from s has the generating function

    G_s(z) = sum_e p_e f_e^(z) G_s'(z),    G_goal(z) = 1,    f^(z) = sum_j f(j) z^j

a linear system for each z, and its distribution follows from N values of z on a circle by the fast
Fourier transform (Howard, Dynamic Probabilistic Systems II, 1971; Abate and Whitt, Queueing Systems
10, 1992). On a circle of radius r < 1, arrivals after N steps or more add at most r^N to each. The
number of decisions, whose law the thesis predicts, is the case in which each takes one step.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray
from scipy.sparse.linalg import splu
from scipy.special import gammainc, gammainccinv

from serd_core import checks
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.display import Record
from serd_core.dynamics.transition_model import transitions_of
from serd_core.mdp.mdp import Mdp, checked_policy
from serd_core.mdp.problem import require_problem
from serd_core.policies.solved_policy import Policy
from serd_core.semi_markov.models import SemiMarkovModels


class GoalProblem(Protocol):
    """An MDP with goal states, such as `NavigationProblem`."""

    @property
    def mdp(self) -> Mdp:
        """The MDP."""

    @property
    def goal_states(self) -> IntArray:
        """Indices of the states that count as arrived."""


def goal_mask(problem: GoalProblem) -> BoolArray:
    """(S,) which states count as arrived: those of `goal_states`, numbers or an (S,) mask."""
    require_problem(problem, "goal_states", "NavigationProblem")
    n_states = problem.mdp.n_states
    mask = np.zeros(n_states, dtype=np.bool_)
    mask[checks.chosen_indices("goal_states", problem.goal_states, n_states, "a state")] = True
    return mask


def policy_chain(
    mdp: Mdp, policy: FloatArray, outcome_probabilities: FloatArray | None
) -> scipy.sparse.csr_array:
    """(S, S) Markov chain of an (S, A) policy; None for transitions without parameters."""
    choice = checked_policy("policy", policy, mdp)
    transitions = transitions_of(mdp.transitions, outcome_probabilities)
    entries = transitions.entries * choice.ravel()[mdp.transitions.row]
    state = mdp.transitions.row // mdp.n_actions
    shape = (mdp.n_states, mdp.n_states)
    return scipy.sparse.csr_array((entries, (state, mdp.transitions.successor)), shape=shape)


@dataclass(frozen=True, eq=False, repr=False)
class ArrivalByState(Record):
    """cdf: (n_steps + 1, S) F_n(s); arrival_probability: (S,) of ever arriving.

    A step is a decision, or where decisions take time a step of time.
    """

    cdf: FloatArray
    arrival_probability: FloatArray

    @classmethod
    def average(cls, each: Iterable["ArrivalByState"]) -> "ArrivalByState":
        """Posterior prediction from that of each draw, of which one is held at a time."""
        cdf, probability, number = np.zeros(()), np.zeros(()), 0
        for one in each:
            cdf, probability = cdf + one.cdf, probability + one.arrival_probability
            number += 1
        return cls(cdf / number, probability / number)

    @property
    def n_steps(self) -> int:
        """The horizon."""
        return len(self.cdf) - 1

    @cached_property
    def mean_steps(self) -> FloatArray:
        """(S,) mean of min(steps until arrival, horizon): sum over n < horizon of 1 - F_n."""
        return np.asarray((1.0 - self.cdf[:-1]).sum(axis=0))

    def within(self, n_steps: int) -> FloatArray:
        """(S,) probability of arriving within so many steps; the horizon where it is beyond."""
        return np.asarray(self.cdf[min(max(n_steps, 0), self.n_steps)])


def probability_of_ever_arriving(chain: scipy.sparse.csr_array, goal: BoolArray) -> FloatArray:
    """(S,) probability of ever being in a goal state, for a start in each state."""
    onward = _onward(chain, goal)
    lost = ~can_reach(onward, goal)
    open_states = np.flatnonzero(can_reach(onward, lost) & ~lost)
    arriving = np.where(lost, 0.0, 1.0)
    if open_states.size:
        arriving[open_states] = _arriving_of_open_states(onward, open_states, ~lost)
    return arriving


def _onward(chain: scipy.sparse.csr_array, goal: BoolArray) -> scipy.sparse.csr_array:
    """(S, S) the steps that lead to another state, none from a goal."""
    steps = scipy.sparse.coo_array(chain)
    steps.sum_duplicates()
    kept = (steps.data > 0) & (steps.row != steps.col) & ~goal[steps.row]
    places = steps.row[kept], steps.col[kept]
    return scipy.sparse.csr_array((steps.data[kept], places), shape=steps.shape)


def can_reach(onward: scipy.sparse.csr_array, target: BoolArray) -> BoolArray:
    """(S,) whether a target (S,) can be reached by the steps of a graph (S, S), or is there."""
    steps, n_states = scipy.sparse.coo_array(onward), len(target)
    goals = np.flatnonzero(target)
    # One more state, from which the reversed steps lead to all targets.
    start = np.concatenate([steps.col, np.full(len(goals), n_states)])
    end = np.concatenate([steps.row, goals])
    shape = (n_states + 1, n_states + 1)
    back = scipy.sparse.csr_array((np.ones(len(start)), (start, end)), shape=shape)
    found = scipy.sparse.csgraph.breadth_first_order(back, n_states, return_predecessors=False)
    return np.isin(np.arange(n_states), found)


def _arriving_of_open_states(
    onward: scipy.sparse.csr_array, open_states: IntArray, not_lost: BoolArray
) -> FloatArray:
    """(n,) probabilities of the states that may arrive and may get lost."""
    inner = onward[open_states][:, open_states]
    symmetric = scipy.sparse.csr_array(inner + inner.T)
    order = scipy.sparse.csgraph.reverse_cuthill_mckee(symmetric, symmetric_mode=True)
    ordered = open_states[order]
    is_open = np.isin(np.arange(len(not_lost)), open_states)
    rows = onward[ordered]
    share = _eliminated(
        rows[:, ordered],
        to_goal=rows[:, np.flatnonzero(not_lost & ~is_open)].sum(axis=1),
        to_lost=rows[:, np.flatnonzero(~not_lost)].sum(axis=1),
    )
    arriving = np.empty(len(open_states))
    arriving[order] = share
    return arriving


def _eliminated(
    inner: scipy.sparse.csr_array, to_goal: FloatArray, to_lost: FloatArray
) -> FloatArray:
    """(n,) share that arrives, from the rates (n, n) within and (n,) out of n states."""
    n_states = len(to_goal)
    entries = scipy.sparse.coo_array(inner)
    offset = entries.col.astype(np.int64) - entries.row
    width = int(np.abs(offset).max(initial=0))
    # [s, s' - s + width]: the logarithms in the band
    band = np.full((n_states, 2 * width + 1), -np.inf)
    band[entries.row, offset + width] = np.log(entries.data)
    with np.errstate(divide="ignore"):
        goal, lost = np.log(to_goal), np.log(to_lost)
    for k in range(n_states):
        last = min(k + width, n_states - 1)
        block, after = _block(band, width, k, last), slice(k + 1, last + 1)
        exit_rate = np.logaddexp.reduce([*block[0, 1:], goal[k], lost[k]])
        block[0, 1:] -= exit_rate
        goal[k] -= exit_rate
        lost[k] -= exit_rate
        into = block[1:, 0]
        block[1:, 1:] = np.logaddexp(block[1:, 1:], into[:, None] + block[0, 1:])
        goal[after] = np.logaddexp(goal[after], into + goal[k])
        lost[after] = np.logaddexp(lost[after], into + lost[k])
        np.fill_diagonal(block[1:, 1:], -np.inf)
    return _substituted(band, width, goal)


def _substituted(band: FloatArray, width: int, goal: FloatArray) -> FloatArray:
    """(n,) shares from the last state, whose goal share is all there is, back to the first."""
    share: FloatArray = np.exp(goal)
    last_state = len(goal) - 1
    for k in range(last_state, -1, -1):
        last = min(k + width, last_state)
        share[k] += np.exp(_block(band, width, k, last)[0, 1:]) @ share[k + 1 : last + 1]
    np.minimum(share, 1.0, out=share)
    return share


def _block(band: FloatArray, width: int, first: int, last: int) -> FloatArray:
    """A square view of rows and columns first..last of a banded matrix; last <= first + w."""
    size, number_bytes = last - first + 1, band.itemsize
    corner = band.ravel()[first * (2 * width + 1) + width :]
    strides = (2 * width * number_bytes, number_bytes)
    return as_strided(corner, shape=(size, size), strides=strides)


#: r^N: what late arrivals may add to a probability; rounding is its inverse times that of a number.
ALIASED = 1e-8
#: Probability of later times below which a law of dwell times has ended.
_NO_MORE = 1e-18
#: Steps, doubled as often as needed, after which the law is constant where a later arrival has at
#: most this probability; where mean and deviation are known, about so many deviations.
SOON, SETTLED, _DEVIATIONS = 512, 1e-4, 4.0
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
    problem: GoalProblem,
    policy: Policy | FloatArray,
    parameters: FloatArray,
    step_s: float,
    n_steps: int,
) -> ArrivalByState:
    """Probability of having arrived within 0, 1, ... n_steps steps of step_s from each state.

    policy: (S, A), or a `Policy`; parameters: (N,) of the dynamics, (0,) of known transitions.
    Where decisions have no dwell times (`semi_markov_problem`), each takes one step. The law is
    constant after 512 steps, or twice as many and so on, where at most a share of 1e-4 arrives
    later from any state.
    Returns cdf (n_steps + 1, S) and arrival_probability (S,) of ever arriving at `goal_states`.
    SerdError for other shapes, or a law that does not fit into memory.

        arrival = sc.timed_arrival(timed, policy, fit.parameters.truth, 0.2, 300)
    """
    checks.require_positive("step_s", step_s, "use 0.1")
    checks.require_count("n_steps", n_steps, 0, "the time-out's")
    chain, laws = _timed_chain(problem, policy, parameters)
    mass = np.array([[0.0, 1.0]]) if laws is None else dwell_steps(*laws, step_s, n_steps)
    mean_s, square_s2 = _moments(chain, laws, step_s)
    certain = np.isfinite(mean_s)
    deviation_s = np.sqrt((square_s2[certain] - mean_s[certain] ** 2).clip(0.0))
    late_s = (mean_s[certain] + _DEVIATIONS * deviation_s).max(initial=0.0)
    soon = SOON
    while soon * step_s < late_s:
        soon *= 2
    return renewal_arrival(chain, mass, n_steps, soon)


def _timed_chain(
    problem: GoalProblem, policy: Policy | FloatArray, parameters: FloatArray
) -> tuple["RenewalChain", tuple[FloatArray, FloatArray] | None]:
    """The moves of a policy, and mean (s) and shape (C,) of their classes; None without times."""
    goal, mdp = goal_mask(problem), problem.mdp
    choice, model = checked_policy("policy", policy, mdp), mdp.transitions
    theta = checks.float_array("parameters", parameters, (model.n_parameters,))
    of_classes = None
    if isinstance(model, SemiMarkovModels):
        laws = model.laws(theta)
        pairs = np.stack([laws.mean_s, laws.shape], axis=2).reshape(-1, 2)
        distinct, place = np.unique(pairs, axis=0, return_inverse=True)
        classes, table = place.reshape(-1)[model.local_index], laws.probability
        of_classes = distinct[:, 0], distinct[:, 1]
    else:
        classes, table = np.zeros(model.n_entries, dtype=np.int64), model.local_probabilities(theta)
    chain = RenewalChain(
        state=model.row // mdp.n_actions,
        successor=model.successor,
        probability=model.entries(table) * choice.ravel()[model.row],
        dwell=classes,
        goal=goal,
    )
    return chain, of_classes


def arrival_moments(
    problem: GoalProblem, policy: FloatArray, parameters: FloatArray, step_s: float
) -> tuple[FloatArray, FloatArray]:
    """(S,) mean (s) and (S,) mean square (s^2) of the time until arrival, by two linear solves.

    inf where it is not certain. The mean square is at least that of a law in steps of step_s.
    """
    checks.require_positive("step_s", step_s, "use 0.1")
    return _moments(*_timed_chain(problem, policy, parameters), step_s)


def _moments(
    chain: "RenewalChain", laws: tuple[FloatArray, FloatArray] | None, step_s: float
) -> tuple[FloatArray, FloatArray]:
    mean_s, shape = (np.full(1, step_s), np.full(1, np.inf)) if laws is None else laws
    square_s2 = mean_s**2 * (1.0 + 1.0 / shape) + step_s**2 / 4.0
    onward = _onward(chain.matrix().tocsr(), chain.goal)
    certain = ~can_reach(onward, ~can_reach(onward, chain.goal))
    inner = np.flatnonzero(certain & ~chain.goal)
    first, second = np.where(certain, 0.0, np.inf), np.where(certain, 0.0, np.inf)
    if not len(inner):
        return first, second
    matrix = chain.matrix()[:, inner][inner, :]
    factor = splu(scipy.sparse.csc_array(scipy.sparse.identity(len(inner)) - matrix))

    def solved(of_moves: FloatArray) -> FloatArray:
        sums = np.bincount(chain.state, chain.probability * of_moves, len(chain.goal))
        return np.asarray(factor.solve(sums[inner]))

    taken_s = mean_s[chain.dwell]
    first[inner] = solved(taken_s)
    after_s = np.where(certain, first, 0.0)[chain.successor]
    second[inner] = solved(square_s2[chain.dwell] + 2.0 * taken_s * after_s)
    return first, second


def dwell_steps(mean_s: FloatArray, shape: FloatArray, step_s: float, n_steps: int) -> FloatArray:
    """(C, n_steps + 1) probability of times that take 0, 1, ... steps.

    mean_s, shape: (C,) of gamma laws; a shape of inf is a time that does not vary. A time between
    two steps is divided between them so that the mean stays what it is. So the probability of step
    i is the second difference, over step_s, of the integral of the law's distribution function.
    """
    ends_s = step_s * np.arange(n_steps + 2)
    integral = np.maximum(ends_s - mean_s[:, None], 0.0)  # where the law has ended, or has no width
    for row in np.flatnonzero(np.isfinite(shape)):
        rate = shape[row] / mean_s[row] * ends_s
        within = slice(np.searchsorted(rate, gammainccinv(shape[row] + 1.0, _NO_MORE)) + 1)
        ends = rate[within]
        integral[row, within] = ends_s[within] * gammainc(shape[row], ends)
        integral[row, within] -= mean_s[row] * gammainc(shape[row] + 1.0, ends)
    mass = np.diff(integral, n=2, prepend=0.0, axis=1) / step_s
    return np.asarray(mass.clip(0.0, 1.0))


def renewal_arrival(
    chain: RenewalChain, mass: FloatArray, n_steps: int, soon: int = SOON
) -> ArrivalByState:
    """The arrival by a chain; moves of class c take j steps with the probability mass[c, j].

    soon: steps that are tried first, see `SOON`.
    """
    size = n_steps + 1
    checks.require_memory(
        f"arrival within {n_steps} steps from each of {len(chain.goal)} states",
        _ARRAYS * 8.0 * size * len(chain.goal),
        "take an earlier time-out, longer steps or larger cells",
    )
    ever = probability_of_ever_arriving(chain.matrix().tocsr(), chain.goal)
    system, soon = _Equations(chain), min(size, soon)
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
        diagonal = np.arange(size) * (size + 1)
        keys = np.concatenate([diagonal, column[self._onward] * size + row[self._onward]])
        distinct, place = np.unique(keys, return_inverse=True)
        self._sums = _sums_by(place, len(distinct)), _sums_by(row[self._arriving], size)
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
            self._matrix.data = self._sums[0] @ entries
            arriving = self._sums[1] @ weights[self._arriving]
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


def _sums_by(index: IntArray, size: int) -> scipy.sparse.csr_array:
    """(size, n) matrix that sums (n,) numbers by their index."""
    places = index.reshape(-1), np.arange(index.size)
    return scipy.sparse.csr_array((np.ones(index.size), places), shape=(size, index.size))
