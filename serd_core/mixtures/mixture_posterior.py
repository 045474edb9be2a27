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

All decisions of a unit are of one latent type. The log-likelihood of unit u under one type is

    l_u = sum n_u(s, a) log pi(a | s) + sum n_u(s, a, s') log P(s' | s, a)
          + sum m_u(s, s') log Z(s, s')

with the counts of `serd_core.demonstrations.observations`, taken per unit.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse
from scipy.special import log_softmax, logsumexp

from serd_core.arrays import FloatArray, IntArray, floored, int_array
from serd_core.ascent.ascent import Objective
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import Observations, observe, taken_transitions
from serd_core.dynamics.transition_model import Transitions
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem
from serd_core.policies.policy_model import MdcePolicy
from serd_core.posterior.beliefs import TiedBelief
from serd_core.posterior.coordinates import Coordinates, gauge_free_basis
from serd_core.posterior.derivatives import posterior_hessian as second
from serd_core.posterior.hidden_actions import expected_counts, move_scores
from serd_core.posterior.parameters import Parameters
from serd_core.posterior.posterior import Posterior, PosteriorValue
from serd_core.priors.prior import Prior


@dataclass(frozen=True, eq=False)
class Units:
    """Sufficient statistics of U units.

    labels: (U,) ascending; pooled: of all units together. choices: (U, S A), transitions: (U, G)
    and moves: (U, T) count what `Observations` has as `state_action`, `group` and `hidden`.
    n_episodes: (U,) of each unit.
    """

    labels: IntArray
    pooled: Observations
    choices: scipy.sparse.csr_array
    transitions: scipy.sparse.csr_array
    moves: scipy.sparse.csr_array
    n_episodes: FloatArray

    def weighted(self, weights: FloatArray) -> Observations:
        """The observations in which unit u counts `weights[u]` times."""
        pooled = self.pooled
        return replace(
            pooled,
            state_action=(weights @ self.choices).reshape(pooled.state_action.shape),
            group_count=np.asarray(weights @ self.transitions),
            hidden=replace(pooled.hidden, count=np.asarray(weights @ self.moves)),
        )

    def log_likelihoods(self, log_policy: FloatArray, true: Transitions) -> FloatArray:
        """(U,) l_u for an (S, A) log policy and P."""
        probability = self.pooled.probabilities(true.local_probabilities)
        found = self.choices @ log_policy.ravel() + self.transitions @ np.log(floored(probability))
        if self.pooled.hidden:
            hidden = expected_counts(self.pooled, log_policy, true)
            found = found + self.moves @ hidden.log_moves
        return np.asarray(found)


def units_of(mdp: Mdp, decisions: Decisions, experts: IntArray | None = None) -> Units:
    """Count by unit; experts: (N,) who took each decision, None for each episode as a unit."""
    given = decisions.episode if experts is None else experts
    labels, unit = np.unique(int_array("experts", given, (len(decisions),)), return_inverse=True)
    episodes, owners = np.unique(np.stack([decisions.episode, labels[unit]]), axis=1)
    if (twice := np.flatnonzero(np.diff(episodes) == 0)).size:
        raise SerdError(
            f"experts must be one per episode, got {owners[twice[0]]} and {owners[twice[0] + 1]} in"
            f" episode {episodes[twice[0]]}; number the experts by episode"
        )
    pooled = observe(mdp, decisions)
    shown, hidden = np.flatnonzero(~decisions.hidden), np.flatnonzero(decisions.hidden)
    taken = taken_transitions(mdp, decisions)[shown]
    pairs = np.stack([decisions.state[hidden], decisions.next_state[hidden]], axis=1)
    moves = np.unique(pairs, axis=0, return_inverse=True)[1].reshape(-1)

    def table(rows: IntArray, place: IntArray, size: int) -> scipy.sparse.csr_array:
        ones, shape = np.ones(len(rows)), (len(labels), size)
        return scipy.sparse.csr_array((ones, (unit[rows], place)), shape=shape)

    chosen = decisions.state[shown] * mdp.n_actions + decisions.action[shown]
    return Units(
        labels=labels.astype(np.int64),
        pooled=pooled,
        choices=table(shown, chosen, pooled.state_action.size),
        transitions=table(shown, np.searchsorted(pooled.key, taken), len(pooled.key)),
        moves=table(hidden, moves, len(pooled.hidden.count)),
        n_episodes=np.unique(owners, return_counts=True)[1].astype(np.float64),
    )


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
    """The log posterior of a number of types; one: coordinates of one type."""
    n_features, shares = len(one.like.reward), n_types - 1
    rewards = shares + np.arange(n_types * n_features).reshape(n_types, n_features)
    dynamics = shares + rewards.size + np.arange(one.table.shape[1] - n_features)
    tables = np.zeros((n_types, len(one.table), shares + rewards.size + len(dynamics)))
    for table, own in zip(tables, rewards, strict=True):
        table[:, np.concatenate([own, dynamics])] = one.table
    share_table = np.zeros((n_types, tables.shape[2]))
    share_table[:, :shares] = gauge_free_basis(np.ones((1, n_types)) / np.sqrt(n_types))
    return MixtureLogPosterior(problem, units, one.like, priors, tables, share_table, rewards)
