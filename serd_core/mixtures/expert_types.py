"""Types of experts found in demonstrations: a mixture of MDCE SERD models with shared dynamics.

Expectation maximisation (Babes et al., ICML 2011) computes responsibilities, then fits types to
units that count by these: one Newton step, shortened until it rises (Lange, Journal of the Royal
Statistical Society B 57, 1995), so no step lowers the log posterior. The best end is finished by
Newton's method. Starts assign units to units that are far apart (k-means++, Arthur and
Vassilvitskii 2007) in the scores of their decisions at the fit of one type.

The number of types T is that of highest BIC = log L - p / 2 log U over U units, where p counts the
rewards of all types and their shares; the dynamics are common to all mixtures. Strengths of the
priors are those of one type, by evidence.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.distance import cdist

from serd_core.arrays import FloatArray, IntArray, require_count
from serd_core.ascent.trust_region import NewtonAscent, quadratic_step
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.decisions import Decisions, require_decisions
from serd_core.errors import SerdError
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.problem import Problem, require_problem
from serd_core.mixtures.mixture_posterior import TIED, MixtureLogPosterior, mixture_of, units_of
from serd_core.posterior.coordinates import coordinates
from serd_core.posterior.parameters import Block
from serd_core.priors.prior import SumOfPriors, terms_of

#: Types that are tried at most, and expected episodes that each must have.
MOST_TYPES, MINIMUM_EPISODES = 5, 3.0
#: Longest M step, in nats over the ranges of features; rise in nats at which EM ends.
RADIUS, SHORTEST, RISE = 4.0, 1e-6, 0.02
#: Starts, EM steps of each, how many of the best are continued, and most steps of these.
N_STARTS, SHORT_RUN, N_CONTINUED, LONG_RUN = 8, 6, 2, 60
#: Responsibility that a start assigns; information that is rounding; distance of equal units.
CERTAINTY, ROUNDING, LEAST = 0.9, 1e-9, 1e-300


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
    where each episode has a type of its own. seed: of the starts of EM.
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
    require_decisions(decisions)
    units = units_of(problem.mdp, decisions, experts)
    fit = fit_mdce_serd(problem, decisions, prior=PriorByEvidence())
    terms = terms_of(fit.assumed.whole_prior)
    dynamics = tuple(term for term in terms if term.blocks == (Block.TRUTH,))
    rewards = tuple(term for term in terms if term.blocks != (Block.TRUTH,))
    priors = SumOfPriors(rewards), SumOfPriors(dynamics)
    return mixture_of(problem, units, priors, coordinates(problem, TIED, fit.parameters), 1)


def _mixture(one_type: MixtureLogPosterior, n_types: int, seed: int) -> ExpertTypes:
    """EM from several starts, then Newton's method to the maximum; types in order of shares."""
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
        vector = best_start(objective, vector, drawn)
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


def best_start(
    objective: MixtureLogPosterior, equal: FloatArray, partitions: Sequence[IntArray]
) -> FloatArray:
    """(D,) of the highest log posterior that EM reaches from partitions (U,); equal: types (D,)."""
    n_types, runs = len(objective.tables), []
    for partition in partitions:
        likely = CERTAINTY * np.eye(n_types)[partition] + (1.0 - CERTAINTY) / n_types
        runs.append(expectation_maximisation(objective, m_step(objective, likely, equal)))
    runs.sort(key=lambda run: -run[-1][0])
    best = [run[-1][1] for run in runs[:N_CONTINUED]]
    longer = [expectation_maximisation(objective, vector, LONG_RUN) for vector in best]
    return max(longer, key=lambda run: run[-1][0])[-1][1]


def expectation_maximisation(
    objective: MixtureLogPosterior, start: FloatArray, n_steps: int = SHORT_RUN
) -> list[tuple[float, FloatArray]]:
    """The log posterior and (D,) vector before and after each step, until it rises too little."""
    run = [(objective.evaluate(start)[0], start)]
    while len(run) <= n_steps and not (len(run) > 1 and run[-1][0] - run[-2][0] < RISE):
        vector = m_step(objective, objective.at(run[-1][1]).responsibilities, run[-1][1])
        run.append((objective.evaluate(vector)[0], vector))
    return run


def m_step(
    objective: MixtureLogPosterior, responsibilities: FloatArray, vector: FloatArray
) -> FloatArray:
    """(D,) after a Newton step that rose on the expected complete-data log posterior, if any."""
    expected = replace(objective, responsibilities=responsibilities, _last=None)
    value, gradient = expected.evaluate(vector)
    curvatures, directions = np.linalg.eigh(-expected.hessian(vector))
    radius = RADIUS
    while radius > SHORTEST:
        reached = vector + quadratic_step(gradient, curvatures, directions, radius)
        if expected.evaluate(reached)[0] > value:
            return np.asarray(reached)
        radius /= 4.0
    return vector


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
    weight = np.asarray(units.choices.sum(axis=1) + units.moves.sum(axis=1))
    values, vectors = np.linalg.eigh(-one_type.hessian(vector)[np.ix_(own, own)])
    known = values > ROUNDING * values[-1]
    whitened = scores @ (vectors[:, known] / np.sqrt(values[known]))
    return np.asarray(whitened / np.sqrt(weight / weight.sum())[:, None])
