"""The learners of the gridworld experiment, by the expert they are compared on."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from lab.bench.given import counted_draws
from lab.estimators.priors import EntropyPrior
from serd_core.arrays import FloatArray
from serd_core.ascent.kinked import KinkedAscent
from serd_core.ascent.trust_region import TrustRegion
from serd_core.bayes.laplace import PosteriorDraws, laplace, laplace_draws
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.decisions import Decisions, start_distribution
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.learners.fit_result import FitResult
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood
from serd_core.learners.policy_matching import clone_behaviour
from serd_core.learners.relative_entropy_irl import fit_relative_entropy_irl, hoeffding_thresholds
from serd_core.learners.serd import fit_mdce_serd, fit_pm_serd
from serd_core.mdp.problem import TabularProblem
from serd_core.posterior.beliefs import FixedBelief
from serd_core.posterior.parameters import Block
from serd_core.priors.prior import GaussianPrior, Prior, UniformPrior

ASCENT = TrustRegion(gradient_tolerance=1e-5, max_steps=150)
#: Hoeffding's thresholds themselves allow all weights to be 0 up to fifty demonstrations.
THRESHOLD_SHARE = 0.1
#: The thesis's estimates have no prior.
NONE = UniformPrior()
FIXED = FixedBelief()
#: Policy matching has its maxima on kinks.
PM_ASCENT = KinkedAscent(smooth=ASCENT, gradient_tolerance=1e-5)
#: Fixes the common scale of rewards and temperature, which demonstrations do not determine.
PM_SCALE = GaussianPrior(0.1, Block.POLICY, mean=1.0)
REGULARISATION = PM_SCALE + GaussianPrior(10.0, Block.REWARD) + EntropyPrior(0.01)


@dataclass(frozen=True, eq=False)
class Estimate:
    """The part of a fit that the measures use; draws: whose policies are averaged."""

    weights: FloatArray
    dynamics: FloatArray
    temperature: float | None
    converged: bool
    draws: PosteriorDraws | None = None

    @classmethod
    def of(cls, fit: FitResult, temperature: float | None = None) -> "Estimate":
        """Weights and dynamics of a fit; temperature: of a Boltzmann policy."""
        return cls(fit.reward_weights, fit.outcome_probabilities, temperature, fit.converged)


@dataclass(frozen=True, eq=False)
class LearnerInput:
    """What a learner gets; n_steps: decisions of an episode at most."""

    problem: TabularProblem
    decisions: Decisions
    n_steps: int
    rng: np.random.Generator

    @cached_property
    def by_evidence(self) -> FitResult:
        """The default of the library, which the thesis leaves to future work; for two learners."""
        return fit_mdce_serd(self.problem, self.decisions)


Learner = Callable[[LearnerInput], Estimate]


def _mdce_serd(given: LearnerInput) -> Estimate:
    problem, seen = given.problem, given.decisions
    first = fit_mdce_serd(problem, seen, rng=given.rng, belief=FIXED, prior=NONE, ascent=ASCENT)
    return Estimate.of(
        fit_mdce_serd(
            problem, seen, initial_weights=first.reward_weights, prior=NONE, ascent=ASCENT
        )
    )


def _serd_by_evidence(given: LearnerInput) -> Estimate:
    return Estimate.of(given.by_evidence)


def _serd_averaged(given: LearnerInput) -> Estimate:
    """The average over its posterior, of random numbers of its own."""
    fit = given.by_evidence
    found = laplace(given.problem, given.decisions, fit)
    draws = laplace_draws(found, given.rng.spawn(1)[0])
    return Estimate(
        draws.reward.mean(axis=0),
        draws.outcome_probabilities.mean(axis=0),
        None,
        fit.converged,
        draws,
    )


def _pm_serd(prior: Prior, given: LearnerInput) -> Estimate:
    problem, seen = given.problem, given.decisions
    first = fit_pm_serd(problem, seen, rng=given.rng, belief=FIXED, prior=prior, ascent=PM_ASCENT)
    fit = fit_pm_serd(
        problem,
        seen,
        initial_weights=first.reward_weights,
        initial_temperature=first.temperature,
        prior=prior,
        ascent=PM_ASCENT,
    )
    return Estimate.of(fit, fit.temperature)


def _mdce_irl(given: LearnerInput) -> Estimate:
    return Estimate.of(
        fit_mdce_irl_by_likelihood(given.problem, given.decisions, rng=given.rng, ascent=ASCENT)
    )


def _irl_same_prior(given: LearnerInput) -> Estimate:
    """SERD's prior of rewards under counted dynamics, averaged over draws of both."""
    problem, seen, rng = given.problem, given.decisions, given.rng.spawn(1)[0]
    fit = fit_mdce_irl_by_likelihood(problem, seen, prior=PriorByEvidence())
    draws = laplace_draws(laplace(problem, seen, fit), rng)
    tables = counted_draws(problem, seen, fit, len(draws), rng)
    drawn = replace(draws, outcome_probabilities=tables, believed_outcome_probabilities=tables)
    return Estimate(fit.reward_weights, tables.mean(axis=0), None, fit.converged, drawn)


def _relative_entropy(given: LearnerInput) -> Estimate:
    problem, seen, n_steps, rng = given.problem, given.decisions, given.n_steps, given.rng
    # As in section 4.6.2: dynamics by M-estimate, policy by smoothed behavioural cloning.
    policy = clone_behaviour(problem, seen)
    samples = sample_decisions(
        problem.mdp,
        policy,
        problem.mdp.transitions.known_probabilities(estimate_dynamics(problem, seen)),
        start_distribution(seen, problem.mdp.n_states),
        n_episodes=500,
        n_steps=n_steps,
        rng=rng,
        source="sampled from estimates",
    )
    thresholds = THRESHOLD_SHARE * hoeffding_thresholds(
        problem, len(seen.episodes), horizon=n_steps
    )
    fit = fit_relative_entropy_irl(
        problem, seen, samples=samples, sampling_policy=policy, thresholds=thresholds, rng=rng
    )
    return Estimate.of(fit)


IRL_LEARNERS: dict[str, Learner] = {"MDCE IRL": _mdce_irl, "REIRL": _relative_entropy}
EXPERTS: dict[str, dict[str, Learner]] = {
    "mdce": {
        "MDCE SERD": _mdce_serd,
        "SERD, evidence": _serd_by_evidence,
        "SERD, averaged": _serd_averaged,
        "IRL, same prior": _irl_same_prior,
    }
    | IRL_LEARNERS,
    "pm": {
        "PM SERD": partial(_pm_serd, PM_SCALE),
        "PM SERD, regularised": partial(_pm_serd, REGULARISATION),
    }
    | IRL_LEARNERS,
}
