"""Coordinates without gauge and units, in which a log posterior is a density.

Adding a constant to all energies of an outcome model changes no probability (the softmax gauge), so
over energies no density can be normalised. And a reward weight has the inverse unit of its feature.
The coordinates u leave both out:

    w_f = u_f / range of f,      energies of a model = B u,   B an orthonormal basis orthogonal to 1

The range of a feature is its largest minus its smallest value over the available pairs (s, a), as a
constant added to a feature changes no policy. So u_f counts nats of reward between the two.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from serd_core.arrays import BoolArray, FloatArray, described
from serd_core.ascent.ascent import Objective
from serd_core.mdp.problem import Problem
from serd_core.posterior.beliefs import Belief
from serd_core.posterior.hessian import posterior_hessian, vector_hessian
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior, PosteriorValue

#: Spread of a feature, relative to its size, that is nothing but rounding.
ROUNDING = 1e-12


def feature_ranges(problem: Problem) -> FloatArray:
    """(F,) range of each feature; its size where it is constant, 1 where it is 0 everywhere."""
    values = problem.features[problem.mdp.available]
    size, spread = np.abs(values).max(axis=0), np.ptp(values, axis=0)
    ranges = np.where(spread > ROUNDING * size, spread, size)
    return np.asarray(np.where(ranges > 0, ranges, 1.0))


@dataclass(frozen=True, eq=False)
class Coordinates:
    """d coordinates of the m free numbers of a fit.

    table: (m, d), free vector = table @ u; like: parameters that give the blocks that are fixed.
    names: (m,) of the free numbers; log_volume: log |d(reward weights) / du|.
    """

    belief: Belief
    like: Parameters
    table: FloatArray
    names: tuple[str, ...]
    log_volume: float

    def parameters(self, u: FloatArray) -> Parameters:
        """All blocks at (d,) coordinates."""
        return self.belief.unpack(self.table @ u, self.like)

    def of(self, parameters: Parameters) -> FloatArray:
        """(d,) coordinates of parameters."""
        return self.of_free(self.belief.pack(parameters))

    def of_free(self, free: FloatArray) -> FloatArray:
        """(..., d) coordinates of (..., m) free numbers, or of moves of them."""
        # The columns of the table are orthogonal; what they leave out is the gauge.
        return np.asarray(free @ (self.table / np.sum(self.table**2, axis=0)))

    def units(self) -> FloatArray:
        """(m,) rewards in nats over the range of their feature, energies as they are."""
        units: FloatArray = np.linalg.norm(self.table, axis=1)
        units[len(self.like.reward) :] = 1.0
        return units

    def describe(self, direction: FloatArray) -> str:
        """A direction (d,) by what moves along it, as shares of the largest, largest first."""
        return described((self.table @ direction) / self.units(), self.names)


def coordinates(problem: Problem, belief: Belief, like: Parameters) -> Coordinates:
    """The coordinates of a problem's free numbers under a belief."""
    jacobian = belief.jacobian(like)
    gauge = free_gauge(problem, like, jacobian)
    scale = np.ones(jacobian.shape[1])
    ranges = feature_ranges(problem)
    scale[: len(ranges)] = 1.0 / ranges
    return Coordinates(
        belief=belief,
        like=like,
        table=scale[:, None] * gauge_free_basis(gauge),
        names=free_names(problem, like, jacobian),
        log_volume=-float(np.sum(np.log(ranges))),
    )


def free_numbers(problem: Problem, belief: Belief, like: Parameters) -> Coordinates:
    """The free numbers themselves as coordinates, with gauge and units."""
    jacobian = belief.jacobian(like)
    names = free_names(problem, like, jacobian)
    return Coordinates(belief, like, np.eye(jacobian.shape[1]), names, log_volume=0.0)


@dataclass(eq=False)
class LogPosterior(Objective):
    """J over `divisor` as a function of coordinates, warm-started from the last value."""

    posterior: Posterior
    coordinates: Coordinates
    last_value: FloatArray | None = None
    divisor: int = 1
    _last: tuple[FloatArray, Parameters, PosteriorValue] | None = None
    _last_hessian: tuple[FloatArray, FloatArray] | None = None

    def evaluate(self, vector: FloatArray) -> tuple[float, FloatArray]:
        parameters, found = self.found(vector)
        by_free = self.coordinates.belief.pull_back(found.gradient, parameters) / self.divisor
        return found.objective / self.divisor, np.asarray(self.coordinates.table.T @ by_free)

    def hessian(self, vector: FloatArray) -> FloatArray:
        """Exact (d, d) second derivatives of J / divisor; those of the last vector are kept."""
        if self._last_hessian is not None and np.array_equal(self._last_hessian[0], vector):
            return self._last_hessian[1]
        parameters, found = self.found(vector)
        learns = self.coordinates.belief.learns_dynamics
        blocks = posterior_hessian(self.posterior, parameters, found, learns_dynamics=learns)
        by_free = vector_hessian(self.coordinates.belief, blocks, found.gradient, parameters)
        by_free /= self.divisor
        hessian = np.asarray(self.coordinates.table.T @ by_free @ self.coordinates.table)
        self._last_hessian = (vector.copy(), hessian)
        return hessian

    def prior_information(self, vector: FloatArray) -> FloatArray:
        """(d, d) minus the second derivatives of the log prior."""
        parameters, belief = self.coordinates.parameters(vector), self.coordinates.belief
        blocks = self.posterior.prior.hessian(self.posterior.problem.mdp.transitions, parameters)
        jacobian = belief.jacobian(parameters) @ self.coordinates.table
        return np.asarray(-jacobian.T @ blocks @ jacobian) / self.divisor

    def found(self, vector: FloatArray) -> tuple[Parameters, PosteriorValue]:
        """Parameters and posterior at a vector; the last are kept."""
        if self._last is None or not np.array_equal(self._last[0], vector):
            parameters = self.coordinates.parameters(vector)
            self._last = (vector.copy(), parameters, self.at(parameters))
        return self._last[1:]

    def at(self, parameters: Parameters) -> PosteriorValue:
        """The posterior at given parameters."""
        found = self.posterior.evaluate(parameters, self.last_value)
        self.last_value = found.solution.value
        return found


def gauge_free_basis(gauge: FloatArray) -> FloatArray:
    """(n, n - g) orthonormal basis of what is orthogonal to (g, n) gauge directions."""
    n_gauge, n_free = gauge.shape
    touched = np.any(gauge != 0, axis=0)
    if not n_gauge:
        return np.eye(n_free)
    complete = scipy.linalg.null_space(gauge[:, touched])
    table = np.zeros((n_free, n_free - n_gauge))
    n_others = int(np.sum(~touched))
    table[np.flatnonzero(~touched), np.arange(n_others)] = 1.0
    table[np.ix_(touched, np.arange(n_others, n_free - n_gauge))] = complete
    return table


def free_names(problem: Problem, parameters: Parameters, jacobian: FloatArray) -> tuple[str, ...]:
    """Name each free number after the blocks it moves."""
    dynamics = problem.mdp.transitions.parameter_names
    rows = [f"reward {name}" for name in problem.feature_names]
    rows += [f"belief {name}" for name in dynamics] + [f"truth {name}" for name in dynamics]
    rows += ["log temperature"] * len(parameters.policy)
    names = []
    for column in jacobian.T:
        moved = [rows[i] for i in np.flatnonzero(column)]
        tied = len(moved) == 2
        names.append(moved[1].replace("truth", "dynamics", 1) if tied else moved[0])
    return tuple(names)


def free_in_use(problem: Problem, parameters: Parameters, jacobian: FloatArray) -> BoolArray:
    """(m,) which free numbers something in the problem depends on."""
    transitions = problem.mdp.transitions
    in_use = np.ones(len(jacobian), dtype=bool)
    for block, values in ((Block.BELIEF, parameters.belief), (Block.TRUTH, parameters.truth)):
        effect = transitions.local_jacobian(values)[np.unique(transitions.local_index)]
        in_use[parameters.place(block)] = np.any(effect != 0, axis=0)
    return np.asarray(np.any(jacobian[in_use] != 0, axis=0))


def free_scaling(posterior: Posterior, at: Parameters, jacobian: FloatArray) -> FloatArray | None:
    """(n,) direction in which weights grow with the temperature, where nothing determines it."""
    if not len(at.policy):
        return None
    both = at.zeros().with_block(Block.REWARD, at.reward).with_block(Block.POLICY, at.policy)
    model, prior = posterior.problem.mdp.transitions, posterior.prior
    held = prior.hessian(model, at) @ both.vector
    if np.any(held) or float(prior.evaluate(model, at).gradient.vector @ both.vector):
        return None
    return np.asarray(np.linalg.lstsq(jacobian, both.vector, rcond=None)[0])


def free_gauge(problem: Problem, parameters: Parameters, jacobian: FloatArray) -> FloatArray:
    """Gauge directions of each dynamics block in the free numbers, orthonormal rows."""
    gauge = problem.mdp.transitions.gauge
    found = []
    for block in (Block.BELIEF, Block.TRUTH):
        columns = np.any(jacobian[parameters.place(block)] != 0, axis=0)
        if columns.any():
            rows = np.zeros((len(gauge), jacobian.shape[1]))
            rows[:, columns] = gauge
            found.append(rows)
    if not found:
        return np.zeros((0, jacobian.shape[1]))
    # Tied blocks give the same rows twice.
    rows = np.unique(np.concatenate(found), axis=0)
    lengths = np.linalg.norm(rows, axis=1, keepdims=True)
    return np.asarray(rows / lengths)
