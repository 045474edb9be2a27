"""The learners of section 5.2 and more, each from demonstrations to something `Learned`.

Where a weight has to be chosen (of the divergence prior or of the coupling), it is the one of the
highest likelihood on the validation episodes; then everything is fitted again to the whole subset,
so that every learner has learned from the same demonstrations.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from experiments.study.fits.learned import Learned, learned_from_fit, learned_from_parts
from experiments.study.fits.uniform_prior import uniform_prior
from experiments.study.settings import LearningSettings
from serd_core.arrays import FloatArray
from serd_core.ascent.trust_region import TrustRegion
from serd_core.demonstrations.decisions import Decisions, start_distribution
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.demonstrations.trajectories import trajectories_of
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.navigation import NavigationProblem
from serd_core.learners.behavioural_cloning import clone_behaviour
from serd_core.learners.fit_result import FitResult
from serd_core.learners.importance_samples import hoeffding_thresholds
from serd_core.learners.mdce_irl import fit_mdce_irl_by_entropy, fit_mdce_irl_by_likelihood
from serd_core.learners.mdce_serd import fit_mdce_serd
from serd_core.learners.relative_entropy_irl import fit_relative_entropy_irl
from serd_core.learners.staged_start import weights_under_initial_dynamics
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior.beliefs import Belief, CoupledBelief, FreeBelief, TiedBelief
from serd_core.posterior.parameters import Block
from serd_core.priors.divergence import KldPrior
from serd_core.priors.gaussian import GaussianPrior
from serd_core.priors.prior import Prior
from serd_core.selection.evaluation import policy_log_likelihood, validation_log_likelihood
from serd_core.selection.prior_weight import select_weight

ASCENT = TrustRegion(gradient_tolerance=1e-5, max_steps=200)
#: Decisions of a sampled trajectory: seven minutes, so that most arrive.
_LONGEST_SAMPLE = 210


@dataclass(frozen=True, eq=False)
class Trial:
    """One subset of demonstrations to learn from, and how it is split to choose a weight.

    reference: (M, K) true dynamics, for the learner that is told them.
    """

    problem: NavigationProblem
    settings: LearningSettings
    subset: Decisions
    training: Decisions
    validation: Decisions
    reference: FloatArray
    rng: np.random.Generator

    @property
    def wide(self) -> Prior:
        """Keeps reward weights finite where a small subset shows one action only."""
        return GaussianPrior(self.settings.reward_deviation, Block.REWARD)

    @property
    def no_idea(self) -> Prior:
        """The uniform prior of the M-estimate on the true dynamics."""
        return uniform_prior(self.problem, Block.TRUTH)

    @property
    def no_idea_of_either(self) -> Prior:
        """The same on the belief, too, where that is another block."""
        return self.no_idea + uniform_prior(self.problem, Block.BELIEF)


def fit_tied(trial: Trial, decisions: Decisions, prior_weight: float) -> FitResult:
    """MDCE SERD: one model is what the expert believes and what is true."""
    return _fit_serd(trial, decisions, TiedBelief(), KldPrior(prior_weight) + trial.no_idea)


def mdce_serd(trial: Trial) -> Learned:
    """MDCE SERD with its lambda chosen on validation."""
    return _selected(trial, lambda decisions, weight: fit_tied(trial, decisions, weight))


def serd_coupled(trial: Trial) -> Learned:
    """SERD whose belief is pulled to the truth, with the pull chosen on validation."""

    def fit(decisions: Decisions, weight: float) -> FitResult:
        return _fit_serd(trial, decisions, CoupledBelief(weight), trial.no_idea_of_either)

    return _selected(trial, fit)


def serd_free(trial: Trial) -> Learned:
    """SERD whose belief has nothing to do with the truth."""
    fit = _fit_serd(trial, trial.subset, FreeBelief(), trial.no_idea_of_either)
    return learned_from_fit(trial.problem, fit)


def irl_by_likelihood(trial: Trial) -> Learned:
    """MDCE IRL under the M-estimate, by likelihood."""
    return _irl(trial, None)


def irl_told_the_truth(trial: Trial) -> Learned:
    """MDCE IRL by likelihood under the reference dynamics, which no other learner is told."""
    return _irl(trial, trial.reference)


def irl_by_entropy(trial: Trial) -> Learned:
    """MDCE IRL under the M-estimate, by causal entropy."""
    fit = fit_mdce_irl_by_entropy(
        trial.problem,
        trial.subset,
        rng=trial.rng,
        slack=trial.settings.entropy_slack,
        ascent=ASCENT,
    )
    return _of_weights(trial, fit.reward_weights, converged=fit.converged)


def relative_entropy_irl(trial: Trial) -> Learned:
    """REIRL on trajectories sampled from estimates, as section 4.6.2 does.

    How much the sampling policy is smoothed, and how wide the thresholds are, decides what comes
    out: too narrow a sample lets the weights grow without bound, too wide thresholds allow them all
    to be 0. Both are chosen on validation, as lambda is for SERD.
    """
    settings = trial.settings
    choices = list(product(settings.reirl_smoothing, settings.reirl_threshold_shares))
    scores = []
    for smoothing, share in choices:
        weights = _fit_reirl(trial, trial.training, smoothing, share).reward_weights
        policy = soft_policy(
            trial.problem, weights, estimate_dynamics(trial.problem, trial.training)
        )
        scores.append(policy_log_likelihood(trial.problem, trial.validation, policy.probabilities))
    fit = _fit_reirl(trial, trial.subset, *choices[int(np.argmax(scores))])
    return _of_weights(trial, fit.reward_weights, converged=fit.converged)


def _fit_reirl(trial: Trial, decisions: Decisions, smoothing: float, share: float) -> FitResult:
    """smoothing: of the cloned policy that samples; share: of Hoeffding's thresholds."""
    problem = trial.problem
    policy = clone_behaviour(problem, decisions, smoothing)
    samples = sample_decisions(
        problem.mdp,
        policy,
        estimate_dynamics(problem, decisions),
        start_distribution(decisions, problem.mdp.n_states),
        n_episodes=trial.settings.reirl_samples,
        n_steps=_LONGEST_SAMPLE,
        rng=trial.rng,
    )
    longest = int(trajectories_of(decisions).length.max())
    thresholds = hoeffding_thresholds(problem, len(decisions.episodes), horizon=longest)
    return fit_relative_entropy_irl(
        problem,
        decisions,
        samples=samples,
        sampling_policy=policy,
        thresholds=share * thresholds,
        rng=trial.rng,
    )


def behavioural_cloning(trial: Trial) -> Learned:
    """The smoothed empirical policy, and its likeliest action for the robot."""
    policy = clone_behaviour(trial.problem, trial.subset)
    return Learned(
        policy=policy,
        greedy=policy.argmax(axis=1),
        truth=estimate_dynamics(trial.problem, trial.subset),
        reward_weights=np.zeros(0),
        converged=True,
    )


Method = Callable[[Trial], Learned]
#: Compared on the scripted people's demonstrations (Figs. 5.9 to 5.11).
METHODS: dict[str, Method] = {
    "MDCE SERD": mdce_serd,
    "SERD, free belief": serd_free,
    "MDCE IRL, likelihood": irl_by_likelihood,
    "MDCE IRL, entropy": irl_by_entropy,
    "REIRL": relative_entropy_irl,
    "cloning": behavioural_cloning,
}
#: What may be assumed about the belief of an expert, from most to least.
ASSUMPTIONS: dict[str, Method] = {
    "fixed (IRL)": irl_by_likelihood,
    "tied": mdce_serd,
    "coupled": serd_coupled,
    "free": serd_free,
    "told the truth (IRL)": irl_told_the_truth,
}
#: What every other method, and every other assumption, is compared with.
OURS, BASELINE = "MDCE SERD", "fixed (IRL)"


def _fit_serd(trial: Trial, decisions: Decisions, belief: Belief, prior: Prior) -> FitResult:
    start = weights_under_initial_dynamics(trial.problem, decisions)
    return fit_mdce_serd(
        trial.problem,
        decisions,
        initial_weights=start,
        belief=belief,
        prior=prior + trial.wide,
        ascent=ASCENT,
    )


def _selected(trial: Trial, fit: Callable[[Decisions, float], FitResult]) -> Learned:
    selection = select_weight(
        lambda weight: fit(trial.training, weight),
        lambda found: validation_log_likelihood(trial.problem, trial.validation, found),
        trial.settings.prior_weights,
    )
    return learned_from_fit(trial.problem, fit(trial.subset, selection.weight), selection.weight)


def _irl(trial: Trial, dynamics: FloatArray | None) -> Learned:
    fit = fit_mdce_irl_by_likelihood(
        trial.problem,
        trial.subset,
        initial_weights=np.zeros(len(trial.problem.feature_names)),
        dynamics=dynamics,
        prior=trial.wide,
        ascent=ASCENT,
    )
    return learned_from_fit(trial.problem, fit)


def _of_weights(trial: Trial, weights: FloatArray, *, converged: bool) -> Learned:
    estimate = estimate_dynamics(trial.problem, trial.subset)
    return learned_from_parts(
        trial.problem, weights, truth=estimate, belief=estimate, converged=converged
    )
