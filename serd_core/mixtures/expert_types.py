"""Types of experts found in demonstrations: a mixture of MDCE SERD models with shared dynamics.

    types = fit_expert_types(problem, decisions, 2)
    chosen = choose_expert_types(problem, decisions).chosen

The number of types T is that of highest evidence (`serd_core.mixtures.evidence`). The strength
sigma of the prior on rewards maximises evidence times its hyperprior for each T; those of priors
on dynamics are of one type. BIC and ICL (Biernacki, Celeux and Govaert, IEEE PAMI 22, 2000), over
units, are given for comparison:

    BIC = log L - D/2 log U,      ICL = BIC - sum_ut r_ut log(1 / r_ut)

A type needs `minimum_episodes` expected episodes; a mixture without them is not chosen.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.optimize
from scipy.special import entr

from serd_core.arrays import FloatArray, IntArray, int_array, require_count, require_generator
from serd_core.ascent.newton_ascent import NewtonAscent
from serd_core.bayes.draws import PosteriorDraws, draws_of
from serd_core.bayes.strengths import DEVIATION, PriorByEvidence, strengths_of
from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.problem import Problem
from serd_core.mixtures.coordinates import mixture_coordinates
from serd_core.mixtures.evidence import laplace_of_mixture
from serd_core.mixtures.expectation_maximisation import EmRun, EmSettings, best_run, unit_scores
from serd_core.mixtures.grouped_observations import GroupedObservations, group_observations
from serd_core.mixtures.mixture_posterior import MixtureLogPosterior, MixturePoint
from serd_core.posterior.beliefs import Belief, TiedBelief
from serd_core.posterior.coordinates import feature_ranges
from serd_core.posterior.parameters import Block
from serd_core.priors.gaussian import GaussianPrior
from serd_core.priors.prior import Prior, SumOfPriors

TIED, SETTINGS = TiedBelief(), EmSettings()
#: Types that are tried at most, and expected episodes that each must have.
MOST_TYPES, MINIMUM_EPISODES = 5, 3.0
#: Types of any mixture; the memory of the evidence grows with the factorial.
LARGEST_MIXTURE = 7
#: Strengths of the prior on rewards that are tried, as factors of that of one type.
WEAKEST, STRONGEST, CLOSE = 0.4, 4.0, 0.1


@dataclass(frozen=True, eq=False)
class ExpertTypes:
    """A mixture of T types, the most frequent first.

    units: (U,) labels of the units; responsibilities: (U, T) probability of each unit's type.
    shares: (T,); reward_weights: (T, F); outcome_probabilities: (M, K) of the shared dynamics;
    believed_outcome_probabilities: (T, M, K). mode, root: of Laplace's approximation in the
    coordinates of the objective. trace: log posterior before and after each step of EM, under the
    strength of the prior of one type.
    n_episodes: (T,) expected. one_type: the fit of one type that it began with.
    converged: whether the last Newton step was within tolerance.
    """

    objective: MixtureLogPosterior
    mode: FloatArray
    root: FloatArray
    log_evidence: float
    trace: FloatArray
    one_type: FitResult
    converged: bool
    message: str

    @cached_property
    def point(self) -> MixturePoint:
        """The mixture at its mode."""
        return self.objective.at(self.mode)

    @property
    def n_types(self) -> int:
        """T."""
        return self.objective.space.n_types

    @property
    def units(self) -> IntArray:
        """(U,) labels."""
        return self.objective.units.labels

    @property
    def responsibilities(self) -> FloatArray:
        """(U, T), rows sum to 1."""
        return self.point.responsibilities

    @property
    def type_of_unit(self) -> IntArray:
        """(U,) the likeliest type, from 0."""
        return np.asarray(np.argmax(self.responsibilities, axis=1))

    @property
    def shares(self) -> FloatArray:
        """(T,) of the units."""
        return np.exp(self.point.log_shares)

    @property
    def reward_weights(self) -> FloatArray:
        """(T, F)."""
        return np.stack([each.reward for each in self.point.parameters])

    @property
    def reward_deviations(self) -> FloatArray:
        """(T, F) standard deviations of the posterior."""
        n_features = self.reward_weights.shape[1]
        spread = self.objective.space.tables[:, :n_features] @ self.root
        return np.asarray(np.linalg.norm(spread, axis=2))

    @property
    def outcome_probabilities(self) -> FloatArray:
        """(M, K)."""
        model = self.objective.problem.mdp.transitions
        return model.local_probabilities(self.point.parameters[0].truth)

    @property
    def believed_outcome_probabilities(self) -> FloatArray:
        """(T, M, K)."""
        model = self.objective.problem.mdp.transitions
        return np.stack([model.local_probabilities(each.belief) for each in self.point.parameters])

    @property
    def n_episodes(self) -> FloatArray:
        """(T,) expected episodes of each type."""
        return np.asarray(self.objective.units.n_episodes @ self.responsibilities)

    @property
    def log_likelihood(self) -> float:
        """Of all decisions under the mixture."""
        return float(self.point.log_marginals.sum())

    @property
    def bic(self) -> float:
        """Larger is better."""
        return self.log_likelihood - 0.5 * len(self.mode) * float(np.log(len(self.units)))

    @property
    def icl(self) -> float:
        """Larger is better."""
        return self.bic - float(entr(self.responsibilities).sum())

    def fit(self, number: int = 0) -> FitResult:
        """The record of one type; its log-likelihoods and steps are those of the mixture."""
        values, parameters = self.point.values, self.point.parameters[number]
        dynamics = sum(each.dynamics_log_likelihood for each in values)
        hidden = sum(each.hidden_log_likelihood for each in values)
        objective, gradient = self.objective.evaluate(self.mode)
        return replace(
            self.one_type,
            parameters=parameters,
            outcome_probabilities=self.outcome_probabilities,
            believed_outcome_probabilities=self.believed_outcome_probabilities[number],
            objective=objective,
            policy_log_likelihood=self.log_likelihood - dynamics - hidden,
            dynamics_log_likelihood=dynamics,
            hidden_log_likelihood=hidden,
            log_prior=self.point.log_prior,
            gradient_norm=float(np.abs(gradient).max()),
            n_steps=len(self.trace) - 1,
            converged=self.converged,
            message=self.message,
            objective_trace=self.trace[1:],
            assumptions=None,
        )

    def unit_log_likelihoods(
        self, decisions: Decisions, experts: IntArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """(V,) log-likelihood of other units under the mixture, and (V, T) their types."""
        units = group_observations(self.objective.problem.mdp, decisions, experts)
        at = replace(self.objective, units=units, _last=None, _last_hessian=None).at(self.mode)
        return at.log_marginals, at.responsibilities

    def draws(self, rng: np.random.Generator, n: int) -> tuple[PosteriorDraws, ...]:
        """n draws of the posterior per type, each of the same dynamics."""
        require_count("n", n, 1, "40")
        require_generator(rng)
        half = rng.standard_normal(((n + 1) // 2, self.root.shape[1]))
        drawn = self.mode + np.concatenate([half, -half])[:n] @ self.root.T
        model = self.objective.problem.mdp.transitions
        types = zip(*map(self.objective.space.parameters, drawn), strict=True)
        return tuple(draws_of(model, at, drawn) for at in types)


@dataclass(frozen=True, eq=False)
class TypeChoice:
    """Mixtures of 1, 2, ... types; minimum_episodes: expected, that each type must have."""

    candidates: tuple[ExpertTypes, ...]
    minimum_episodes: float = MINIMUM_EPISODES

    @property
    def chosen(self) -> ExpertTypes:
        """That of highest evidence among those of one type or whose types have enough episodes."""
        least = self.minimum_episodes
        allowed = (x for x in self.candidates if x.n_types == 1 or np.all(x.n_episodes >= least))
        return max(allowed, key=lambda each: each.log_evidence)


@dataclass(frozen=True, eq=False)
class TypeSearch:
    """Fits mixtures of any number of types to the same units.

    one_type: the fit of one type, whose strengths of priors are those of the dynamics here.
    """

    problem: Problem
    units: GroupedObservations
    one_type: FitResult
    settings: EmSettings = SETTINGS

    def mixture(self, n_types: int) -> ExpertTypes:
        """The mixture of that many types of highest posterior, with the strength of its prior.

        Where no maximum is certified, `converged` is False.
        """
        objective = self.objective(n_types, self.own_deviation)
        run = best_run(objective, self.one_type.parameters, self._scores, self.settings)
        if n_types == 1:
            return self._finished(objective, run)
        found: dict[float, ExpertTypes] = {}

        def loss(log_deviation: float) -> float:
            deviation = float(np.exp(log_deviation))
            near = min(found, key=lambda each: abs(each - deviation), default=None)
            start = run if near is None else replace(run, vector=found[near].mode)
            here = self._finished(self.objective(n_types, deviation), start)
            found[deviation] = here
            return -here.log_evidence - DEVIATION.log_density(log_deviation)[0]

        own = np.log(self.own_deviation)
        bounds = own + np.log(WEAKEST), own + np.log(STRONGEST)
        best = scipy.optimize.minimize_scalar(
            loss, bounds=bounds, method="bounded", options={"xatol": CLOSE}
        )
        return found[float(np.exp(best.x))]

    def objective(self, n_types: int, deviation: float) -> MixtureLogPosterior:
        """The log posterior of a mixture; deviation: sigma of its rewards."""
        assumed = self.one_type.assumed
        space = mixture_coordinates(self.problem, assumed.belief, self.one_type.parameters, n_types)
        widths = deviation / feature_ranges(self.problem)
        prior = _with_rewards(assumed.whole_prior, GaussianPrior(tuple(widths), Block.REWARD))
        return MixtureLogPosterior(self.problem, self.units, space, prior)

    @property
    def own_deviation(self) -> float:
        """sigma of the fit of one type."""
        return strengths_of(self.one_type.assumed.prior, self.problem)["deviation"]

    @cached_property
    def _scores(self) -> FloatArray:
        objective = self.objective(1, self.own_deviation)
        return unit_scores(objective, objective.space.of((self.one_type.parameters,), np.zeros(1)))

    def _finished(self, objective: MixtureLogPosterior, run: EmRun) -> ExpertTypes:
        """Newton's method to the maximum, types in order of shares, and the evidence there."""
        space = objective.space
        ended = NewtonAscent().maximise(objective, run.vector)
        order = np.argsort(-space.log_shares(ended.vector), kind="stable")
        mode = space.reordered(ended.vector, order)
        try:
            root, log_evidence = laplace_of_mixture(objective, mode)
        except SerdError as error:
            # Of no use for a choice: the point is no maximum.
            root, log_evidence = np.full((space.size,) * 2, np.nan), -np.inf
            ended = replace(ended, converged=False, message=str(error))
        return ExpertTypes(
            objective=objective,
            mode=mode,
            root=root,
            log_evidence=log_evidence,
            trace=run.trace,
            one_type=self.one_type,
            converged=ended.converged,
            message=ended.message,
        )


def fit_expert_types(
    problem: Problem,
    decisions: Decisions,
    n_types: int,
    *,
    experts: IntArray | None = None,
    belief: Belief = TIED,
    settings: EmSettings = SETTINGS,
) -> ExpertTypes:
    """A mixture of a given number of types; arguments as in `choose_expert_types`."""
    search = _search(problem, decisions, experts, belief, settings)
    _require_types(n_types, len(search.units))
    return search.mixture(n_types)


def choose_expert_types(
    problem: Problem,
    decisions: Decisions,
    *,
    most_types: int = MOST_TYPES,
    minimum_episodes: float = MINIMUM_EPISODES,
    experts: IntArray | None = None,
    belief: Belief = TIED,
    settings: EmSettings = SETTINGS,
) -> TypeChoice:
    """Mixtures of 1, 2, ... types until one more lowers the evidence.

    experts: (N,) number of the expert who took each decision, whose episodes share their type; None
    where each episode has a type of its own. belief: relation of each type's belief to the world.
    """
    search = _search(problem, decisions, experts, belief, settings)
    most = min(most_types, len(search.units))
    _require_types(most, len(search.units))
    candidates = [search.mixture(1)]
    for n_types in range(2, most + 1):
        candidates.append(search.mixture(n_types))
        if candidates[-1].log_evidence <= candidates[-2].log_evidence:
            break
    return TypeChoice(tuple(candidates), minimum_episodes)


def _search(
    problem: Problem,
    decisions: Decisions,
    experts: IntArray | None,
    belief: Belief,
    settings: EmSettings,
) -> TypeSearch:
    one_type = fit_mdce_serd(problem, decisions, belief=belief, prior=PriorByEvidence())
    units = group_observations(problem.mdp, decisions, experts)
    if experts is not None:
        _require_one_expert(decisions, int_array("experts", experts, (len(decisions),)))
    return TypeSearch(problem, units, one_type, settings)


def _with_rewards(prior: Prior, rewards: GaussianPrior) -> Prior:
    """The prior with another one on rewards."""
    if isinstance(prior, SumOfPriors):
        return SumOfPriors(tuple(_with_rewards(term, rewards) for term in prior.terms))
    return rewards if prior.blocks == (Block.REWARD,) else prior


def _require_types(n_types: int, n_units: int) -> None:
    # The evidence compares all orders of the types, of which there are n_types!.
    require_count("n_types", n_types, 0, "2")
    most = min(n_units, LARGEST_MIXTURE)
    if not 1 <= n_types <= most:
        raise SerdError(
            f"n_types must be from 1 to {most} ({n_units} experts or episodes, at most"
            f" {LARGEST_MIXTURE} types), got {n_types}; ask for fewer types or record more"
        )


def _require_one_expert(decisions: Decisions, experts: IntArray) -> None:
    """SerdError where an episode has two experts."""
    pairs = np.unique(np.stack([decisions.episode, experts], axis=1), axis=0)
    if (twice := np.flatnonzero(np.diff(pairs[:, 0]) == 0)).size:
        raise SerdError(
            f"experts must be one per episode, got {pairs[twice[0], 1]} and"
            f" {pairs[twice[0] + 1, 1]} in episode {pairs[twice[0], 0]}; number the experts by"
            " episode"
        )
