"""Recursive logit: route choice as an undiscounted soft MDP, for all destinations at once.

With v = beta . x(a | k), M[k, a] = exp v(a | k) and b_d[k] = 1 on the exits of destination d, the
soft Bellman equation without discount is linear in z = exp V:

    z_d = M z_d + b_d,          log P(trip) = beta . (sum of its features) - V_d(origin)

(Fosgerau, Frejinger and Karlstrom, Transportation Research B 56, 2013). I - M is the same for all
destinations, so one factorisation serves them all, their derivatives and the adjoint. The series
sum M^n b converges where the spectral radius of M is below 1, which holds exactly where
(I - M) x = 1 has a positive solution (I - M then is an M-matrix; Berman and Plemmons 1994,
theorem 6.2.3); it then is at least 1 everywhere. With M_f = M * x_f and M_fg = M * x_f * x_g, entry
by entry:

    dz_f = (I - M)^-1 M_f z,    d2z_fg = (I - M)^-1 (M_f dz_g + M_g dz_f + M_fg z)

The log-likelihood is concave, as V is a log-sum-exp over routes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from lab.routes.network import RouteNetwork, Trips
from serd_core.arrays import FloatArray, IntArray
from serd_core.ascent.ascent import Objective, Scaled
from serd_core.ascent.trust_region import NewtonAscent
from serd_core.checks import (
    float_array,
    int_array,
    require_each,
    require_generator,
    require_index,
    require_memory,
)
from serd_core.errors import SerdError
from serd_core.learners.certificate import judged_weights
from serd_core.uncertainty.standard_errors import covariance_of

#: Tables of links by destinations that exist at a time, besides one per feature.
COPIES = 6
#: How far below 1 rounding may bring the solution that certifies convergence.
ROUNDING = 1e-6
#: Times that equal costs are doubled until the series converges.
DOUBLINGS = 30
#: Size of a utility, and of the logarithm of a value, beyond which exponentials are not exact.
LARGEST_UTILITY = 700.0


@dataclass(frozen=True, eq=False)
class RouteValues:
    """exp V at weights: the factor of I - M, (T,) numbers of M, (L, D) z and (N,) z at origins."""

    factor: Any
    flow: FloatArray
    z: FloatArray
    at_origin: FloatArray


@dataclass(eq=False)
class RouteLikelihood(Objective):
    """The log-likelihood of trips as a function of the (F,) weights; -inf where M diverges."""

    network: RouteNetwork
    trips: Trips
    _last: tuple[FloatArray, RouteValues | None] | None = field(default=None, repr=False)
    _slope_tables: tuple[RouteValues, list[FloatArray]] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        n_goals, n_features = len(self.trips.destinations), len(self.network.feature_names)
        assert self.network.exits is not None
        goals, fix = self.trips.destinations, "add the exit or drop the destination"
        known = np.isin(goals, self.network.exits[:, 1])
        require_each("destinations", goals, known, "have an exit in the network", fix)
        copies = COPIES + n_features
        require_memory(
            f"value functions of {self.network.n_links} links and {n_goals} destinations",
            8.0 * copies * self.network.n_links * n_goals,
            "fit fewer destinations at a time",
        )

    def evaluate(self, vector: FloatArray) -> tuple[float, FloatArray]:
        """Log-likelihood and its (F,) gradient."""
        found = self.values(vector)
        if found is None:
            return -np.inf, np.zeros_like(vector)
        value = float(np.sum(self.trips.features @ vector) - np.sum(np.log(found.at_origin)))
        passed = self._edge_products(self._adjoint(found), found.z) * found.flow
        return value, self.trips.features.sum(axis=0) - self.network.features.T @ passed

    def values(self, weights: FloatArray) -> RouteValues | None:
        """z of every destination; the last are kept.

        None where the series diverges, or a trip's value is too small to be a float.
        """
        if self._last is None or not np.array_equal(self._last[0], weights):
            self._last = (weights.copy(), self._solved(weights))
        return self._last[1]

    def scores(self, weights: FloatArray) -> FloatArray:
        """(N, F) gradient of the log-probability of each trip."""
        return (
            self.trips.features
            - self._slopes(weights) / self.solution_at(weights).at_origin[:, None]
        )

    def hessian(self, vector: FloatArray) -> FloatArray:
        """(F, F) second derivatives: those of -log z at the origins, by one adjoint solve."""
        found, network = self.solution_at(vector), self.network
        slopes = self._slopes(vector) / found.at_origin[:, None]
        adjoint = self._adjoint(found)
        table = slopes.T @ slopes
        pairs = self._edge_products(adjoint, found.z)
        table -= (network.features * (pairs * found.flow)[:, None]).T @ network.features
        for f, by_f in enumerate(self._by_weight(vector)):
            edge = self._edge_products(adjoint, by_f) * found.flow
            mixed = network.features.T @ edge
            table[f] -= mixed
            table[:, f] -= mixed
        return np.asarray(table)

    def _adjoint(self, found: RouteValues) -> FloatArray:
        """(L, D) derivative of the sum of log z at the origins by the right-hand sides b."""
        pull = np.zeros_like(found.z)
        np.add.at(pull, (self.trips.origin, self.trips.to), 1.0 / found.at_origin)
        adjoint: FloatArray = found.factor.solve(pull, trans="T")
        return adjoint

    def _edge_products(self, left: FloatArray, right: FloatArray) -> FloatArray:
        """(T,) sum over destinations of left(from link) right(to link)."""
        network = self.network
        parts = [
            np.einsum("td,td->t", left[network.from_link[some]], right[network.to_link[some]])
            for some in np.array_split(
                np.arange(len(network.from_link)), 1 + len(network.from_link) // 4096
            )
        ]
        return np.concatenate(parts)

    def _slopes(self, weights: FloatArray) -> FloatArray:
        """(N, F) derivative of z at each trip's origin."""
        at = (self.trips.origin, self.trips.to)
        return np.stack([table[at] for table in self._by_weight(weights)], axis=1)

    def _by_weight(self, weights: FloatArray) -> list[FloatArray]:
        """F tables (L, D): derivative of z by each weight."""
        found = self.solution_at(weights)
        if self._slope_tables is None or self._slope_tables[0] is not found:
            tables = [
                found.factor.solve(self.network.matrix(found.flow * column) @ found.z)
                for column in self.network.features.T
            ]
            self._slope_tables = (found, tables)
        return self._slope_tables[1]

    def solution_at(self, weights: FloatArray) -> RouteValues:
        found = self.values(weights)
        if found is None:
            raise SerdError(_diverges(weights))
        return found

    def _solved(self, weights: FloatArray) -> RouteValues | None:
        utilities = self.network.features @ weights
        if not np.all(np.abs(utilities) < LARGEST_UTILITY):
            return None
        flow = np.exp(utilities)
        identity = scipy.sparse.csc_array(scipy.sparse.identity(self.network.n_links))
        try:
            factor = scipy.sparse.linalg.splu(
                scipy.sparse.csc_array(identity - self.network.matrix(flow)),
                permc_spec="MMD_AT_PLUS_A",  # elimination of M-matrices needs no row exchanges,
                diag_pivot_thresh=0.0,  # and then loses no small values
                options={"SymmetricMode": True},
            )
        except RuntimeError:  # exactly singular
            return None
        if not np.all(factor.solve(np.ones(self.network.n_links)) >= 1.0 - ROUNDING):
            return None
        z = factor.solve(self._exits)
        at_origin = z[self.trips.origin, self.trips.to]
        is_exact = bool(np.all(at_origin > np.exp(-LARGEST_UTILITY)))
        return RouteValues(factor, flow, z, at_origin) if is_exact else None

    @cached_property
    def _exits(self) -> FloatArray:
        """(L, D) exits of each destination."""
        table = np.zeros((self.network.n_links, len(self.trips.destinations)))
        for place, goal in enumerate(self.trips.destinations):
            table[self.network.exits_of(int(goal)), place] = 1.0
        return table


@dataclass(frozen=True, eq=False)
class RouteFit:
    """Weights of highest likelihood.

    weights: (F,); information: (F, F) observed; scores: (N, F) of each trip, 0 in sum.
    """

    feature_names: tuple[str, ...]
    weights: FloatArray
    log_likelihood: float
    information: FloatArray
    scores: FloatArray
    n_steps: int
    converged: bool
    message: str

    @property
    def standard_errors(self) -> FloatArray:
        """(F,) from the observed information; infinite where that is singular."""
        return np.asarray(np.sqrt(np.diag(self._covariance)))

    @property
    def robust_errors(self) -> FloatArray:
        """(F,) of the sandwich, trips independent of each other."""
        inverse = self._covariance
        if not np.all(np.isfinite(inverse)):
            return self.standard_errors
        spread = inverse @ self.scores.T @ self.scores @ inverse
        return np.asarray(np.sqrt(np.diag(spread)))

    @property
    def _covariance(self) -> FloatArray:
        return covariance_of(self.information)


def fit_routes(
    network: RouteNetwork,
    trips: Trips,
    *,
    initial_weights: FloatArray | None = None,
    max_steps: int = 200,
) -> RouteFit:
    """Most likely weights by Newton's method, certified by its step.

    initial_weights: (F,) at which the series converges; None for equal costs that are doubled until
    it does, which needs features that are not negative.
    """
    likelihood = RouteLikelihood(network, trips)
    start = _start(likelihood, initial_weights)
    sizes = np.abs(network.features).max(axis=0)
    scale = 1.0 / np.where(sizes > 0, sizes, 1.0)
    scaled, names = Scaled(likelihood, scale), network.feature_names
    found = scaled.maximum(NewtonAscent(max_steps=max_steps), start)
    found, _ = judged_weights(scaled, found, scale, names, "leave these features out")
    weights = found.vector
    return RouteFit(
        feature_names=network.feature_names,
        weights=weights,
        log_likelihood=found.objective,
        information=-likelihood.hessian(weights),
        scores=likelihood.scores(weights),
        n_steps=found.n_steps,
        converged=found.converged,
        message=found.message,
    )


def route_values(
    network: RouteNetwork, weights: FloatArray, destinations: Sequence[int] | IntArray
) -> FloatArray:
    """(L, D) V of each link and destination; -inf where it cannot be reached.

    SerdError where the undiscounted series does not converge.
    """
    checked = float_array("weights", weights, (len(network.feature_names),))
    goals = int_array("destinations", destinations, (None,))
    none = np.zeros(0, dtype=np.int64)
    trips = Trips(none, goals, none, np.zeros((0, len(network.feature_names))))
    found = RouteLikelihood(network, trips).solution_at(checked)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.maximum(found.z, 0.0)), dtype=np.float64)


def _start(likelihood: RouteLikelihood, initial_weights: FloatArray | None) -> FloatArray:
    features: FloatArray = likelihood.network.features
    if initial_weights is not None:
        given = float_array("initial_weights", initial_weights, (features.shape[1],))
        if likelihood.values(given) is None:
            raise SerdError(_diverges(given))
        return given
    mean = np.abs(features).mean(axis=0)
    mean = np.where(mean > 0, mean, 1.0)
    for power in range(DOUBLINGS):
        start: FloatArray = -(2.0**power) / (mean * features.shape[1])
        if not np.all(features @ start > -LARGEST_UTILITY):
            break
        if likelihood.values(start) is not None:
            return start
    raise SerdError(
        "initial_weights must be given, as for no equal costs the undiscounted series converged"
        " and every trip was likelier than exp(-700); pass weights that make every cycle of links"
        " costly"
    )


def _diverges(weights: FloatArray) -> str:
    return (
        "weights must make the undiscounted series of routes converge, but the spectral radius of"
        f" exp(utilities) is 1 or more at {weights.tolist()}, or a route costs more than 700:"
        " cycles of links cost too little; use lower weights, or a constant per link"
    )


def sample_routes(
    network: RouteNetwork,
    weights: FloatArray,
    origins: Sequence[int] | IntArray,
    destinations: Sequence[int] | IntArray,
    *,
    rng: np.random.Generator,
) -> list[list[int]]:
    """The links of one route per pair of origin and destination.

    P(a | k) = M[k, a] z_a / z_k, and 1 / z_k to end at k.
    """
    require_generator(rng)
    wanted = int_array("destinations", destinations, (None,))
    starts = int_array("origins", origins, (len(wanted),))
    require_index("origins", starts, network.n_links, "a link")
    goals, column = np.unique(wanted, return_inverse=True)
    values = route_values(network, weights, goals)
    utility = network.features @ np.asarray(weights, dtype=np.float64)
    first = np.searchsorted(network.from_link, np.arange(network.n_links + 1))
    exits = [set(network.exits_of(int(goal)).tolist()) for goal in goals]
    routes = []
    for origin, place in zip(starts.tolist(), column.tolist(), strict=True):
        value, link, route = values[:, place], int(origin), [int(origin)]
        if not np.isfinite(value[link]):
            raise SerdError(
                f"destination {goals[place]} must be reached from origin {origin}, but no turns"
                " lead there; choose another pair"
            )
        while True:
            turns = np.arange(first[link], first[link + 1])
            onward = np.exp(utility[turns] + value[network.to_link[turns]] - value[link])
            ends = float(np.exp(-value[link])) if link in exits[place] else 0.0
            level = rng.random() * (ends + onward.sum())
            if level < ends:
                break
            taken = int(np.searchsorted(ends + np.cumsum(onward), level, side="right"))
            link = int(network.to_link[turns[min(taken, len(turns) - 1)]])
            route.append(link)
        routes.append(route)
    return routes
