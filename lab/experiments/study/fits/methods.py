"""The learners of section 5.2 and more, each from demonstrations to something `Learned`.

They are the product's (`serd_app.learning.methods`), an imitator, and one that knows the truth.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from lab.bench.given import counted_draws
from lab.experiments.study.fits.baselines import mdce_irl_entropy, relative_entropy_irl
from serd_app.learning import methods as product
from serd_app.learning.methods import FitData, MethodResult
from serd_core.arrays import FloatArray, IntArray
from serd_core.bayes.laplace import laplace, laplace_draws, posterior_policy
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.grid.navigation import NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood
from serd_core.learners.policy_matching import clone_behaviour
from serd_core.policies.solved_policy import optimal_policy
from serd_core.selection.evaluation import fitted_policy


@dataclass(frozen=True, eq=False)
class Learned:
    """policy: (S, A) what the expert is expected to do; greedy: (S,) what the robot will do.

    truth: (M, K) the dynamics; reward_weights: (F,), empty where none are learned.
    converged: whether every fit behind it did; prior_weight: what validation chose, or None.
    """

    policy: FloatArray
    greedy: IntArray
    truth: FloatArray
    reward_weights: FloatArray
    converged: bool
    prior_weight: float | None = None

    def values(self) -> dict[str, Any]:
        """What a model is kept as."""
        return {
            "greedy": self.greedy.tolist(),
            "truth": self.truth.tolist(),
            "reward_weights": self.reward_weights.tolist(),
        }


def learned_from_fit(
    problem: NavigationProblem, fit: FitResult, prior_weight: float | None = None
) -> Learned:
    """Actions are predicted by the belief, as the expert planned; the robot plans by the truth."""
    truth = fit.outcome_probabilities
    return Learned(
        policy=fitted_policy(problem, fit),
        greedy=optimal_policy(problem, fit.reward_weights, truth).greedy,
        truth=truth,
        reward_weights=fit.reward_weights,
        converged=fit.converged,
        prior_weight=prior_weight,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class Trial(FitData):
    """One subset of demonstrations; reference: (M, K) true dynamics, for one learner only."""

    reference: FloatArray

    @cached_property
    def by_evidence(self) -> FitResult:
        """SERD by evidence, which two ways of predicting share."""
        return product.mdce_serd_evidence(self).fit


Method = Callable[[Trial], Learned]


def by(method: Callable[[FitData], MethodResult]) -> Method:
    """A method of the product as one of the study."""

    def learn(trial: Trial) -> Learned:
        found = method(trial)
        return learned_from_fit(trial.problem, found.fit, found.prior_weight)

    return learn


def irl_with_true_dynamics(trial: Trial) -> Learned:
    """MDCE IRL by likelihood under the reference dynamics, which no other learner knows."""
    return learned_from_fit(trial.problem, product.fit_rewards(trial, trial.reference))


def behavioural_cloning(trial: Trial) -> Learned:
    """The smoothed empirical policy, and its likeliest action for the robot."""
    policy = clone_behaviour(trial.problem, trial.decisions)
    return Learned(
        policy=policy,
        greedy=policy.argmax(axis=1),
        truth=trial.estimate(trial.decisions),
        reward_weights=np.zeros(0),
        converged=True,
    )


def serd_averaged(trial: Trial) -> Learned:
    """SERD by evidence, which predicts by the average over its posterior (Laplace)."""
    found = trial.by_evidence
    draws = laplace_draws(laplace(trial.problem, trial.decisions, found), np.random.default_rng(0))
    return replace(
        learned_from_fit(trial.problem, found), policy=posterior_policy(trial.problem, draws)
    )


def irl_same_prior(trial: Trial) -> Learned:
    """MDCE IRL under counted dynamics with SERD's prior, averaged over draws of both."""
    problem, seen = trial.problem, trial.decisions
    fit = fit_mdce_irl_by_likelihood(problem, seen, prior=PriorByEvidence())
    rng = np.random.default_rng(0)
    draws = laplace_draws(laplace(problem, seen, fit), rng)
    tables = counted_draws(problem, seen, fit, len(draws), rng)
    policy = posterior_policy(problem, replace(draws, believed_outcome_probabilities=tables))
    return replace(learned_from_fit(problem, fit), policy=policy, truth=tables.mean(axis=0))


#: Compared on the scripted people's demonstrations (Figs. 5.9 to 5.11).
METHODS: dict[str, Method] = {
    "MDCE SERD": by(product.mdce_serd),
    "SERD, free belief": by(product.mdce_serd_free),
    "SERD, evidence": lambda trial: learned_from_fit(trial.problem, trial.by_evidence),
    "MDCE IRL, likelihood": by(product.mdce_irl),
    "MDCE IRL, entropy": by(mdce_irl_entropy),
    "REIRL": by(relative_entropy_irl),
    "cloning": behavioural_cloning,
}
#: As one of `METHODS` that the robot drives by, with other predictions of the expert's actions.
PREDICTORS: dict[str, Method] = {
    "SERD, averaged": serd_averaged,
    "IRL, same prior": irl_same_prior,
}
#: What may be assumed about the belief of an expert, from most to least.
ASSUMPTIONS: dict[str, Method] = {
    "fixed (IRL)": by(product.mdce_irl),
    "tied": by(product.mdce_serd),
    "coupled": by(product.mdce_serd_coupled),
    "free": by(product.mdce_serd_free),
    "true dynamics (IRL)": irl_with_true_dynamics,
}
#: What every other method, and every other assumption, is compared with.
OURS, BASELINE = "MDCE SERD", "fixed (IRL)"
