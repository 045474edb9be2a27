"""The log posterior of a mixture of expert types, with exact gradient and Hessian.

Unit u (an expert, or an episode) is of one latent type t with share rho_t. Types have rewards w_t
(and beliefs b_t) of their own and one world theta_T:

    J(u) = sum_u log sum_t rho_t exp l_ut + sum_t log P(w_t, b_t) + log P(theta_T) + log P(rho)

With the responsibilities r_ut = rho_t exp l_ut / sum, which are the probabilities of the types,

    dJ  = sum_u sum_t r_ut d(log rho_t + l_ut) + prior
    d2J = sum_u sum_t r_ut d2(log rho_t + l_ut) + sum_u Cov_{r_u}[d(log rho_t + l_ut)] + prior

(Fisher; Louis 1982). So both are those of one type at weighted counts, plus one term. With given
responsibilities J is the expected complete-data log posterior, the objective of an M step.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.special import gammaln, logsumexp

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import Objective
from serd_core.mdp.problem import Problem
from serd_core.mixtures.coordinates import MixtureCoordinates
from serd_core.mixtures.grouped_observations import GroupedObservations
from serd_core.policies.policy_model import MdcePolicy, PolicyModel
from serd_core.posterior.derivatives.posterior_hessian import (
    Sensitivities,
    posterior_hessian,
    sensitivities_at,
    transition_scores,
    vector_hessian,
)
from serd_core.posterior.hidden_actions import move_scores
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior, PosteriorValue
from serd_core.priors.prior import Prior, SumOfPriors, UniformPrior

#: Pseudo-count of each type: shares are uniform a priori.
SHARE_COUNT = 1.0


@dataclass(frozen=True, eq=False)
class MixturePoint:
    """What a vector gives.

    parameters: (T,) of the types; log_shares: (T,); log_likelihoods: (U, T) l_ut; posteriors and
    values: (T,) of each type at weighted counts. responsibilities: (U, T), those that were given
    where some were.
    """

    parameters: tuple[Parameters, ...]
    log_shares: FloatArray
    log_likelihoods: FloatArray
    responsibilities: FloatArray
    posteriors: tuple[Posterior, ...]
    values: tuple[PosteriorValue, ...]

    @cached_property
    def log_marginals(self) -> FloatArray:
        """(U,) log-likelihood of each unit under the mixture."""
        return np.asarray(logsumexp(self.log_likelihoods + self.log_shares, axis=1))

    @property
    def log_prior(self) -> float:
        """That of all types and of the shares, without the constant of the shares."""
        shares = SHARE_COUNT * float(self.log_shares.sum())
        return sum(value.log_prior for value in self.values) + shares


@dataclass(eq=False)
class MixtureLogPosterior(Objective):
    """J of T types; prior: of one type, whose part of theta_T counts once.

    responsibilities: (U, T) of an M step, None for the observed-data log posterior.
    """

    problem: Problem
    units: GroupedObservations
    space: MixtureCoordinates
    prior: Prior
    policy_model: PolicyModel = field(default_factory=MdcePolicy)
    responsibilities: FloatArray | None = None
    _starts: dict[int, FloatArray] = field(default_factory=dict)
    _last: tuple[FloatArray, MixturePoint] | None = None
    _last_hessian: tuple[FloatArray, FloatArray] | None = None

    def with_responsibilities(self, given: FloatArray) -> "MixtureLogPosterior":
        """The objective of an M step."""
        return replace(self, responsibilities=given, _last=None, _last_hessian=None)

    def evaluate(self, vector: FloatArray) -> tuple[float, FloatArray]:
        """J and its (D,) gradient."""
        at = self.at(vector)
        gradient = self._share_gradient(at)
        for table, parameters, value in zip(
            self.space.tables, at.parameters, at.values, strict=True
        ):
            gradient += table.T @ self.space.belief.pull_back(value.gradient, parameters)
        if self.responsibilities is None:
            return float(at.log_marginals.sum()) + at.log_prior, gradient
        joint = at.log_likelihoods + at.log_shares
        return float(np.sum(self.responsibilities * joint)) + at.log_prior, gradient

    def hessian(self, vector: FloatArray) -> FloatArray:
        """Exact (D, D) second derivatives; those of the last vector are kept."""
        if self._last_hessian is None or not np.array_equal(self._last_hessian[0], vector):
            self._last_hessian = (vector.copy(), self._hessian(self.at(vector)))
        return self._last_hessian[1]

    def prior_information(self, vector: FloatArray) -> FloatArray:
        """(D, D) minus the second derivatives of the log prior."""
        at, belief, model = self.at(vector), self.space.belief, self.problem.mdp.transitions
        total = -self._share_curvature(at, SHARE_COUNT * self.space.n_types)
        for table, parameters, posterior in zip(
            self.space.tables, at.parameters, at.posteriors, strict=True
        ):
            jacobian = belief.jacobian(parameters) @ table
            total -= jacobian.T @ posterior.prior.hessian(model, parameters) @ jacobian
        return np.asarray(total)

    def log_constant(self, vector: FloatArray) -> float:
        """What makes the prior's value a log density over the coordinates."""
        at, n_types = self.at(vector), self.space.n_types
        model = self.problem.mdp.transitions
        of_types = sum(
            posterior.prior.log_constant(model, parameters)
            for posterior, parameters in zip(at.posteriors, at.parameters, strict=True)
        )
        log_beta = n_types * gammaln(SHARE_COUNT) - gammaln(n_types * SHARE_COUNT)
        return float(of_types + 0.5 * np.log(n_types) - log_beta) + self.space.log_volume

    def at(self, vector: FloatArray) -> MixturePoint:
        """Everything at a vector; that of the last is kept."""
        if self._last is None or not np.array_equal(self._last[0], vector):
            self._last = (vector.copy(), self._point(vector))
        return self._last[1]

    def unit_scores(self, vector: FloatArray) -> FloatArray:
        """(T, U, D) gradients of l_ut."""
        at = self.at(vector)
        return self._unit_scores(at, self._sensitivities(at))

    def _point(self, vector: FloatArray) -> MixturePoint:
        parameters, log_shares = self.space.parameters(vector), self.space.log_shares(vector)
        priors = [self.prior, *[_without_truth(self.prior)] * (self.space.n_types - 1)]
        posteriors = [
            Posterior(self.problem, self.units.pooled, self.policy_model, prior) for prior in priors
        ]
        numbered = enumerate(zip(posteriors, parameters, strict=True))
        found = np.stack([self._log_likelihoods(t, *each) for t, each in numbered], axis=1)
        joint = found + log_shares
        weights = self.responsibilities
        if weights is None:
            weights = np.exp(joint - logsumexp(joint, axis=1, keepdims=True))
        weighted = [
            replace(posterior, observations=self.units.weighted(column))
            for posterior, column in zip(posteriors, weights.T, strict=True)
        ]
        values = [
            posterior.evaluate(each, self._starts[number])
            for number, (posterior, each) in enumerate(zip(weighted, parameters, strict=True))
        ]
        return MixturePoint(parameters, log_shares, found, weights, tuple(weighted), tuple(values))

    def _log_likelihoods(
        self, number: int, posterior: Posterior, parameters: Parameters
    ) -> FloatArray:
        _, true, solution, log_policy = posterior.solved(parameters, self._starts.get(number))
        self._starts[number] = solution.value
        return self.units.log_likelihoods(log_policy, true)

    def _share_gradient(self, at: MixturePoint) -> FloatArray:
        counts = at.responsibilities.sum(axis=0) + SHARE_COUNT
        off = counts - counts.sum() * np.exp(at.log_shares)
        return np.asarray(self.space.share_table.T @ off)

    def _share_curvature(self, at: MixturePoint, count: float) -> FloatArray:
        shares = np.exp(at.log_shares)
        inner = np.diag(shares) - np.outer(shares, shares)
        table = self.space.share_table
        return np.asarray(-count * (table.T @ inner @ table))

    def _hessian(self, at: MixturePoint) -> FloatArray:
        n_types, n_units = self.space.n_types, len(self.units)
        total = self._share_curvature(at, n_units + SHARE_COUNT * n_types)
        parts = self._sensitivities(at)
        for table, posterior, parameters, value, part in zip(
            self.space.tables, at.posteriors, at.parameters, at.values, parts, strict=True
        ):
            blocks = posterior_hessian(posterior, parameters, value, part)
            free = vector_hessian(self.space.belief, blocks, value.gradient, parameters)
            total += table.T @ free @ table
        if self.responsibilities is None:
            scores = self._unit_scores(at, parts) + self.space.share_table[:, None]
            total += _covariance(scores, at.responsibilities)
        return np.asarray((total + total.T) / 2.0)

    def _sensitivities(self, at: MixturePoint) -> list[Sensitivities]:
        of_types = zip(at.posteriors, at.parameters, at.values, strict=True)
        return [sensitivities_at(*each) for each in of_types]

    def _unit_scores(self, at: MixturePoint, parts: list[Sensitivities]) -> FloatArray:
        """(T, U, D) gradients of l_ut."""
        found = []
        for table, posterior, parameters, value, part in zip(
            self.space.tables, at.posteriors, at.parameters, at.values, parts, strict=True
        ):
            of_transitions = transition_scores(posterior, parameters, value, part)
            of_moves = move_scores(value.expected, of_transitions)
            jacobian = self.space.belief.jacobian(parameters)
            of_units = self.units.transitions @ of_transitions + self.units.moves @ of_moves
            found.append(np.asarray(of_units) @ jacobian @ table)
        return np.stack(found)


def _covariance(scores: FloatArray, responsibilities: FloatArray) -> FloatArray:
    """(D, D) sum_u Cov_{r_u} of scores (T, U, D)."""
    weights = responsibilities.T[:, :, None]
    centred = scores - np.sum(weights * scores, axis=0)
    flat = (np.sqrt(weights) * centred).reshape(-1, scores.shape[2])
    return np.asarray(flat.T @ flat)


def _without_truth(prior: Prior) -> Prior:
    """The prior less its terms over theta_T."""
    if isinstance(prior, SumOfPriors):
        return SumOfPriors(tuple(map(_without_truth, prior.terms)))
    return UniformPrior() if prior.blocks == (Block.TRUTH,) else prior
