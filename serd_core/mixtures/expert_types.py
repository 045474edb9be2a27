"""Types of experts found in demonstrations: a mixture of MDCE SERD models with shared dynamics.

Unit u (an expert, or an episode) is of one latent type t with share rho_t. Types have rewards w_t
of their own and one world theta, which all of them know. With l_ut, the log-likelihood of the
decisions of a unit under a type, and the responsibilities r_ut = rho_t exp l_ut / sum,

    J    = sum_u log sum_t rho_t exp l_ut + sum_t log P(w_t) + log P(theta) + log P(rho)
    dJ   = sum_u sum_t r_ut d(log rho_t + l_ut) + prior
    d2J  = sum_u sum_t r_ut d2(log rho_t + l_ut) + sum_u Cov_{r_u}[d(log rho_t + l_ut)] + prior

(Fisher; Louis 1982), those of one type at weighted counts plus one term. The D coordinates are log
odds of the shares without gauge, the rewards of each type, and the dynamics, u = [shares | rewards
1..T | dynamics], in units of `serd_core.posterior.coordinates`.

Newton's method climbs J from several starts, which assign units to units that are far apart
(k-means++, Arthur and Vassilvitskii 2007) in the scores of their decisions at the fit of one type;
the highest maximum is the mixture (docs/mixed_experts.md).
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse
from scipy.spatial.distance import cdist
from scipy.special import log_softmax, logsumexp

from serd_core.arrays import FloatArray, IntArray, floored, int_array, require_count
from serd_core.ascent.ascent import AscentResult, Objective
from serd_core.ascent.trust_region import NewtonAscent
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.decisions import Decisions, require_shown
from serd_core.demonstrations.observations import Observations, observe, taken_transitions
from serd_core.dynamics.transition_model import Transitions
from serd_core.errors import SerdError
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem, require_problem
from serd_core.policies.policy_model import MdcePolicy
from serd_core.posterior.beliefs import TiedBelief
from serd_core.posterior.coordinates import Coordinates, coordinates, gauge_free_basis
from serd_core.posterior.derivatives import posterior_hessian as second
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior, PosteriorValue
from serd_core.priors.prior import Prior, SumOfPriors, terms_of

TIED = TiedBelief()
#: Pseudo-count of each type: shares are uniform a priori.
SHARE_COUNT = 1.0
#: Types that are tried at most, and expected episodes that each must have.
MOST_TYPES, MINIMUM_EPISODES = 5, 3.0
#: Starts, Newton steps at given types, and those on J after which one start is chosen.
N_STARTS, FIRST_STEPS, STEPS = 8, 6, 12
#: Probability of the type that a start assigns; information that is rounding.
CERTAINTY, ROUNDING = 0.9, 1e-9
#: Squared distance of equal units.
LEAST = 1e-300


@dataclass(frozen=True, eq=False)
class ExpertTypes:
    """A mixture of T types, the most frequent first.

    units: (U,) labels; responsibilities: (U, T) probability of each unit's type; shares: (T,);
    reward_weights, reward_deviations: (T, F) mode of the posterior and standard deviations there;
    outcome_probabilities: (M, K) of the shared dynamics; n_episodes: (T,) expected.
    log_likelihood: of all decisions; converged: whether the last Newton step was within tolerance.
    """

    units: IntArray
    responsibilities: FloatArray
    shares: FloatArray
    reward_weights: FloatArray
    reward_deviations: FloatArray
    outcome_probabilities: FloatArray
    n_episodes: FloatArray
    log_likelihood: float
    converged: bool
    message: str

    @property
    def n_types(self) -> int:
        """T."""
        return len(self.shares)

    @property
    def type_of_unit(self) -> IntArray:
        """(U,) the likeliest type, from 0."""
        return np.asarray(np.argmax(self.responsibilities, axis=1))

    @property
    def bic(self) -> float:
        """Larger is better."""
        n_numbers = self.reward_weights.size + self.n_types - 1
        return self.log_likelihood - 0.5 * n_numbers * float(np.log(len(self.units)))


@dataclass(frozen=True, eq=False)
class Units:
    """Counts (U, S A) and (U, G) by unit of what `Observations` pools of all of them."""

    labels: IntArray
    pooled: Observations
    choices: scipy.sparse.csr_array
    transitions: scipy.sparse.csr_array
    n_episodes: FloatArray

    def weighted(self, weights: FloatArray) -> Observations:
        """The observations in which unit u counts `weights[u]` times."""
        pooled = self.pooled
        return replace(
            pooled,
            state_action=(weights @ self.choices).reshape(pooled.state_action.shape),
            group_count=np.asarray(weights @ self.transitions),
        )

    def log_likelihoods(self, log_policy: FloatArray, true: Transitions) -> FloatArray:
        """(U,) l_u for an (S, A) log policy and P."""
        probability = self.pooled.probabilities(true.local_probabilities)
        by_transition = self.transitions @ np.log(floored(probability))
        return np.asarray(self.choices @ log_policy.ravel() + by_transition)


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

    def table(place: IntArray, size: int) -> scipy.sparse.csr_array:
        shape = len(labels), size
        return scipy.sparse.csr_array((np.ones(len(unit)), (unit, place)), shape=shape)

    taken = np.searchsorted(pooled.key, taken_transitions(mdp, decisions))
    chosen = decisions.state * mdp.n_actions + decisions.action
    return Units(
        labels=labels.astype(np.int64),
        pooled=pooled,
        choices=table(chosen, pooled.state_action.size),
        transitions=table(taken, len(pooled.key)),
        n_episodes=np.unique(owners, return_counts=True)[1].astype(np.float64),
    )


@dataclass(frozen=True, eq=False)
class MixturePoint:
    """What a vector gives: (T,), (U, T) l_ut, (U, T) r_ut, and each type at weighted counts."""

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
            scores, (_, parameters, _) = second.transition_scores(*of_type, part), of_type
            of_units = np.asarray(units.transitions @ scores)
            found.append(of_units @ TIED.jacobian(parameters) @ table)
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


def fit_expert_types(
    problem: Problem,
    decisions: Decisions,
    n_types: int,
    *,
    experts: IntArray | None = None,
    seed: int = 0,
) -> ExpertTypes:
    """Fit a mixture of a given number of types of experts, who differ in their reward weights.

    experts: (N,) number of the expert who took each decision, whose episodes share their type; None
    where each episode has a type of its own. seed: of the starts.
    """
    require_count("n_types", n_types, 1, "2")
    start = _one_type(problem, decisions, experts)
    if n_types > (n_units := len(start.units.labels)):
        raise SerdError(
            f"n_types must be at most {n_units}, the number of experts or episodes, got {n_types};"
            " ask for fewer types or record more"
        )
    return _mixture(start, n_types, seed)


def choose_expert_types(
    problem: Problem,
    decisions: Decisions,
    *,
    most_types: int = MOST_TYPES,
    minimum_episodes: float = MINIMUM_EPISODES,
    experts: IntArray | None = None,
    seed: int = 0,
) -> ExpertTypes:
    """Choose the number of types of experts: the mixture of highest BIC, until one more lowers it.

    most_types: where the search ends; minimum_episodes: expected, that each type must have;
    experts, seed: as in `fit_expert_types`.

        mixture = sc.choose_expert_types(problem, decisions)
    """
    require_count("most_types", most_types, 1, "2")
    start = _one_type(problem, decisions, experts)
    best = _mixture(start, 1, seed)
    for n_types in range(2, min(most_types, len(start.units.labels)) + 1):
        found = _mixture(start, n_types, seed)
        enough = found.converged and found.n_episodes.min() >= minimum_episodes
        if not enough or found.bic <= best.bic:
            break
        best = found
    return best


def _one_type(
    problem: Problem, decisions: Decisions, experts: IntArray | None
) -> MixtureLogPosterior:
    """The log posterior of one type, `like` being its fit, with the priors of all mixtures."""
    require_problem(problem)
    require_shown(decisions, "types of experts")
    units = units_of(problem.mdp, decisions, experts)
    fit = fit_mdce_serd(problem, decisions, prior=PriorByEvidence())
    terms = terms_of(fit.assumed.whole_prior)
    dynamics = tuple(term for term in terms if term.blocks == (Block.TRUTH,))
    rewards = tuple(term for term in terms if term.blocks != (Block.TRUTH,))
    priors = SumOfPriors(rewards), SumOfPriors(dynamics)
    return mixture_of(problem, units, priors, coordinates(problem, TIED, fit.parameters), 1)


def _mixture(one_type: MixtureLogPosterior, n_types: int, seed: int) -> ExpertTypes:
    """The highest maximum from several starts; types in order of shares."""
    problem, units = one_type.problem, one_type.units
    one = coordinates(problem, TIED, one_type.like)
    objective = mixture_of(problem, units, one_type.priors, one, n_types)
    rewards, begun = objective.rewards, one.of(one.like)
    vector = np.zeros(objective.tables.shape[2])
    vector[rewards] = begun[: rewards.shape[1]]
    vector[rewards[-1, -1] + 1 :] = begun[rewards.shape[1] :]
    if n_types > 1:
        points, rng = unit_scores(one_type, begun), np.random.default_rng([seed, n_types])
        drawn = [drawn_partition(points, n_types, rng) for _ in range(N_STARTS)]
        climbed = [_climbed(objective, partition, vector) for partition in drawn]
        vector = max(climbed, key=lambda ended: ended.objective).vector
    ended = NewtonAscent().maximise(objective, vector)
    at = objective.at(ended.vector)
    order = np.argsort(-at.log_shares, kind="stable")
    responsibilities = at.responsibilities[:, order]
    spread = np.linalg.pinv(-objective.hessian(ended.vector), hermitian=True)
    parameters = [at.types[number][1] for number in order]
    scale = np.diag(one.table)[: rewards.shape[1]]
    return ExpertTypes(
        units=units.labels,
        responsibilities=responsibilities,
        shares=np.exp(at.log_shares)[order],
        reward_weights=np.stack([of_type.reward for of_type in parameters]),
        reward_deviations=scale * np.sqrt(np.maximum(np.diag(spread), 0))[rewards[order]],
        outcome_probabilities=problem.mdp.transitions.local_probabilities(parameters[0].truth),
        n_episodes=units.n_episodes @ responsibilities,
        log_likelihood=float(at.log_marginals.sum()),
        converged=ended.converged,
        message=ended.message,
    )


def _climbed(
    objective: MixtureLogPosterior, partition: IntArray, equal: FloatArray
) -> AscentResult:
    """A short climb of J from a partition (U,) of the units; equal: (D,) with all types alike."""
    n_types = len(objective.tables)
    likely = CERTAINTY * np.eye(n_types)[partition] + (1.0 - CERTAINTY) / n_types
    expected = replace(objective, responsibilities=likely, _last=None)
    apart = NewtonAscent(max_steps=FIRST_STEPS).maximise(expected, equal)
    return NewtonAscent(max_steps=STEPS).maximise(objective, apart.vector)


def drawn_partition(points: FloatArray, n_parts: int, rng: np.random.Generator) -> IntArray:
    """(U,) part of each of the points (U, d): that of the nearest of k-means++ centres."""
    centres = [int(rng.integers(len(points)))]
    while len(centres) < n_parts:
        squared = cdist(points, points[centres], "sqeuclidean").min(axis=1) + LEAST
        centres.append(int(rng.choice(len(points), p=squared / squared.sum())))
    return np.asarray(np.argmin(cdist(points, points[centres], "sqeuclidean"), axis=1))


def unit_scores(one_type: MixtureLogPosterior, vector: FloatArray) -> FloatArray:
    """(U, d) scores of the units by the rewards of one type, in standard errors of their own.

    A direction without information is left out.
    """
    own, units = one_type.rewards[0], one_type.units
    scores = one_type.unit_scores(vector)[0][:, own]
    weight = np.asarray(units.choices.sum(axis=1))
    values, vectors = np.linalg.eigh(-one_type.hessian(vector)[np.ix_(own, own)])
    known = values > ROUNDING * values[-1]
    whitened = scores @ (vectors[:, known] / np.sqrt(values[known]))
    return np.asarray(whitened / np.sqrt(weight / weight.sum())[:, None])
