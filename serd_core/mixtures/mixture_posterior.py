"""The log posterior of a mixture of expert types, with exact gradient and Hessian.

Unit u (an expert, or an episode) is of one latent type t with share rho_t. Types have rewards w_t
of their own and one world theta, which all of them know:

    J(u) = sum_u log sum_t rho_t exp l_ut + sum_t log P(w_t) + log P(theta) + log P(rho)

With the responsibilities r_ut = rho_t exp l_ut / sum, which are the probabilities of the types,

    dJ  = sum_u sum_t r_ut d(log rho_t + l_ut) + prior
    d2J = sum_u sum_t r_ut d2(log rho_t + l_ut) + sum_u Cov_{r_u}[d(log rho_t + l_ut)] + prior

(Fisher; Louis 1982). So both are those of one type at weighted counts, plus one term. With given
responsibilities J is the expected complete-data log posterior, the objective of an M step.

The D coordinates are log odds of the shares without gauge, the rewards of each type, and the
dynamics, u = [shares | rewards 1..T | dynamics], in units of `serd_core.posterior.coordinates`.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.special import log_softmax, logsumexp

from serd_core.arrays import FloatArray, IntArray
from serd_core.ascent.ascent import Objective
from serd_core.mdp.problem import Problem
from serd_core.mixtures.units import Units
from serd_core.policies.policy_model import MdcePolicy
from serd_core.posterior.beliefs import TiedBelief
from serd_core.posterior.coordinates import Coordinates, gauge_free_basis
from serd_core.posterior.derivatives import posterior_hessian as second
from serd_core.posterior.hidden_actions import move_scores
from serd_core.posterior.parameters import Parameters
from serd_core.posterior.posterior import Posterior, PosteriorValue
from serd_core.priors.prior import Prior

TIED = TiedBelief()
#: Pseudo-count of each type: shares are uniform a priori.
SHARE_COUNT = 1.0


@dataclass(frozen=True, eq=False)
class MixturePoint:
    """What a vector gives: log_shares (T,), log_likelihoods l_ut (U, T), responsibilities (U, T),
    and of each type its posterior at weighted counts, its parameters and the value there."""

    log_shares: FloatArray
    log_likelihoods: FloatArray
    responsibilities: FloatArray
    types: tuple[tuple[Posterior, Parameters, PosteriorValue], ...]

    @property
    def log_marginals(self) -> FloatArray:
        """(U,) log-likelihood of each unit under the mixture."""
        return np.asarray(logsumexp(self.log_likelihoods + self.log_shares, axis=1))

    @cached_property
    def sensitivities(self) -> list[second.Sensitivities]:
        """(T,) derivatives of policy and transitions of each type."""
        return [second.sensitivities_at(*of_type) for of_type in self.types]


@dataclass(eq=False)
class MixtureLogPosterior(Objective):
    """J of T types; see `mixture_of`.

    like: gives fixed blocks; priors: of the rewards of a type, and of the dynamics. tables: (T, m,
    D), the free numbers of type t are `tables[t] @ u`; share_table: (T, D), log shares up to a
    constant; rewards: (T, F) places. responsibilities: (U, T) of an M step, else None.
    """

    problem: Problem
    units: Units
    like: Parameters
    priors: tuple[Prior, Prior]
    tables: FloatArray
    share_table: FloatArray
    rewards: IntArray
    responsibilities: FloatArray | None = None
    _starts: dict[int, FloatArray] = field(default_factory=dict)
    _last: tuple[FloatArray, MixturePoint] | None = None

    def evaluate(self, vector: FloatArray) -> tuple[float, FloatArray]:
        """J and its (D,) gradient."""
        at = self.at(vector)
        counts = at.responsibilities.sum(axis=0) + SHARE_COUNT
        gradient = self.share_table.T @ (counts - counts.sum() * np.exp(at.log_shares))
        total = SHARE_COUNT * float(at.log_shares.sum())
        for table, (_, parameters, value) in zip(self.tables, at.types, strict=True):
            gradient += table.T @ TIED.pull_back(value.gradient, parameters)
            total += value.log_prior
        if self.responsibilities is None:
            return total + float(at.log_marginals.sum()), np.asarray(gradient)
        joint = at.log_likelihoods + at.log_shares
        return total + float(np.sum(self.responsibilities * joint)), np.asarray(gradient)

    def hessian(self, vector: FloatArray) -> FloatArray:
        """Exact (D, D) second derivatives."""
        at, shares = self.at(vector), np.exp(self.at(vector).log_shares)
        count = len(self.units.labels) + SHARE_COUNT * len(shares)
        spread = np.diag(shares) - np.outer(shares, shares)
        total = -count * (self.share_table.T @ spread @ self.share_table)
        for table, of_type, part in zip(self.tables, at.types, at.sensitivities, strict=True):
            blocks, (_, parameters, value) = second.posterior_hessian(*of_type, part), of_type
            free = second.vector_hessian(TIED, blocks, value.gradient, parameters)
            total += table.T @ free @ table
        if self.responsibilities is None:
            weights = at.responsibilities.T[:, :, None]
            scores = self.unit_scores(vector) + self.share_table[:, None]
            apart = np.sqrt(weights) * (scores - np.sum(weights * scores, axis=0))
            total += np.einsum("tui,tuj->ij", apart, apart, optimize=True)
        return np.asarray((total + total.T) / 2.0)

    def unit_scores(self, vector: FloatArray) -> FloatArray:
        """(T, U, D) gradients of l_ut."""
        at, units, found = self.at(vector), self.units, []
        for table, of_type, part in zip(self.tables, at.types, at.sensitivities, strict=True):
            scores, (_, parameters, value) = second.transition_scores(*of_type, part), of_type
            of_units = units.transitions @ scores + units.moves @ move_scores(
                value.expected, scores
            )
            found.append(np.asarray(of_units) @ TIED.jacobian(parameters) @ table)
        return np.stack(found)

    def at(self, vector: FloatArray) -> MixturePoint:
        """Everything at a vector; that of the last is kept."""
        if self._last is None or not np.array_equal(self._last[0], vector):
            self._last = (vector.copy(), self._point(vector))
        return self._last[1]

    def _point(self, vector: FloatArray) -> MixturePoint:
        log_shares, found, posteriors = log_softmax(self.share_table @ vector), [], []
        parameters = [TIED.unpack(table @ vector, self.like) for table in self.tables]
        for number, own in enumerate(parameters):
            prior = self.priors[0] if number else self.priors[0] + self.priors[1]
            posterior = Posterior(self.problem, self.units.pooled, MdcePolicy(), prior)
            _, true, solution, log_policy = posterior.solved(own, self._starts.get(number))
            self._starts[number] = solution.value
            found.append(self.units.log_likelihoods(log_policy, true))
            posteriors.append(posterior)
        table, weights = np.stack(found, axis=1), self.responsibilities
        if weights is None:
            weights = np.exp(log_softmax(table + log_shares, axis=1))
        types = []
        for number, own in enumerate(parameters):
            seen = self.units.weighted(weights[:, number])
            weighted = replace(posteriors[number], observations=seen)
            value = weighted.evaluate(own, self._starts[number])
            types.append((weighted, own, value))
        return MixturePoint(log_shares, table, weights, tuple(types))


def mixture_of(
    problem: Problem, units: Units, priors: tuple[Prior, Prior], one: Coordinates, n_types: int
) -> MixtureLogPosterior:
    """That of a number of types; one: coordinates of one type."""
    n_features, shares = len(one.like.reward), n_types - 1
    rewards = shares + np.arange(n_types * n_features).reshape(n_types, n_features)
    dynamics = shares + rewards.size + np.arange(one.table.shape[1] - n_features)
    tables = np.zeros((n_types, len(one.table), shares + rewards.size + len(dynamics)))
    for table, own in zip(tables, rewards, strict=True):
        table[:, np.concatenate([own, dynamics])] = one.table
    share_table = np.zeros((n_types, tables.shape[2]))
    share_table[:, :shares] = gauge_free_basis(np.ones((1, n_types)) / np.sqrt(n_types))
    return MixtureLogPosterior(problem, units, one.like, priors, tables, share_table, rewards)
