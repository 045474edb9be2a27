"""Learners of rewards alone that the study compares with: causal entropy, and relative entropy."""

from itertools import product

import numpy as np

from lab.experiments.study.settings import ComparisonSettings
from serd_app.learning.methods import ASCENT, FitData, MethodResult, OnStep
from serd_core.demonstrations.decisions import Decisions, start_distribution
from serd_core.demonstrations.simulation import sample_decisions, trajectories_of
from serd_core.learners.fit_result import FitResult
from serd_core.learners.mdce_irl import fit_mdce_irl_by_entropy
from serd_core.learners.policy_matching import clone_behaviour
from serd_core.learners.relative_entropy_irl import fit_relative_entropy_irl, hoeffding_thresholds
from serd_core.selection.evaluation import validation_log_likelihood


def _settings(data: FitData) -> ComparisonSettings:
    assert isinstance(data.settings, ComparisonSettings)
    return data.settings


def mdce_irl_entropy(data: FitData) -> MethodResult:
    """MDCE IRL by causal entropy under the M-estimate."""
    slack = _settings(data).entropy_slack
    fit = fit_mdce_irl_by_entropy(
        data.problem,
        data.decisions,
        rng=data.rng,
        dynamics=data.estimate(data.decisions),
        slack=slack,
        ascent=ASCENT,
        on_step=data.reporter(),
    )
    return MethodResult(fit, f"none; features match within a slack of {slack:g} times the weights")


def relative_entropy_irl(data: FitData) -> MethodResult:
    """Relative entropy IRL on trajectories sampled from estimates (section 4.6.2).

    Narrow samples let the weights grow without bound, and wide thresholds allow all weights to be
    0. So the smoothing of the sampling policy and the share of Hoeffding's thresholds are chosen on
    validation; a single episode gets the first of each.
    """
    settings = _settings(data)
    choices = list(product(settings.reirl_smoothing, settings.reirl_threshold_shares))
    best = 0
    if len(data.validation):
        scores = []
        for number, (smoothing, share) in enumerate(choices, start=1):
            on_step = data.reporter(number, len(choices) + 1)
            found = _fit_relative_entropy(data, data.training, smoothing, share, on_step)
            scores.append(validation_log_likelihood(data.problem, data.validation, found))
        best = int(np.argmax(scores))
    smoothing, share = choices[best]
    on_step = data.reporter(len(choices) + 1, len(choices) + 1)
    fit = _fit_relative_entropy(data, data.decisions, smoothing, share, on_step)
    return MethodResult(fit, f"none; thresholds {share:g} of Hoeffding's, smoothing {smoothing:g}")


def _fit_relative_entropy(
    data: FitData, decisions: Decisions, smoothing: float, share: float, on_step: OnStep
) -> FitResult:
    """smoothing: of the cloned policy that samples; share: of Hoeffding's thresholds."""
    problem, estimate = data.problem, data.estimate(decisions)
    policy = clone_behaviour(problem, decisions, smoothing)
    seen = trajectories_of(decisions)
    longest = int(seen.length.max())
    longest_cut_off = seen.length[~problem.mdp.final[seen.end]].max(initial=0)
    samples = sample_decisions(
        problem.mdp,
        policy,
        estimate,
        start_distribution(decisions, problem.mdp.n_states),
        n_episodes=_settings(data).reirl_samples,
        n_steps=max(_settings(data).reirl_sample_decisions, int(longest_cut_off)),
        rng=data.rng,
    )
    thresholds = hoeffding_thresholds(problem, len(decisions.episodes), horizon=longest)
    return fit_relative_entropy_irl(
        problem,
        decisions,
        samples=samples,
        sampling_policy=policy,
        thresholds=share * thresholds,
        dynamics=estimate,
        rng=data.rng,
        on_step=on_step,
    )
