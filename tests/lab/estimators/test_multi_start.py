"""Several starts, and fits that validation stops."""

from dataclasses import replace

import numpy as np
import pytest

from lab.estimators.early_stopping import fit_serd_with_early_stopping, validation_score
from lab.estimators.multi_start import multi_start
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.learners.serd import fit_mdce_serd, fit_pm_serd
from serd_core.policies.solved_policy import MdcePolicy
from serd_core.posterior.beliefs import TiedBelief
from serd_core.posterior.parameters import Block
from serd_core.priors.divergence import DirichletPrior, KldPrior
from serd_core.priors.prior import GaussianPrior, UniformPrior
from serd_core.selection.evaluation import split_episodes, validation_log_likelihood
from support.small_problems import apart

#: Thirty decisions for a, two thirds of which led on.
ALWAYS_A = apart(0, 0, [0, 1, 1] * 10)


def test_the_ambiguity_of_the_minimum_example_is_shown(minimum_example):
    """Both explanations of section 4.6.1: b leads on less often, or more often, than a."""
    prior = KldPrior(0.1) + GaussianPrior(2.0, Block.REWARD)
    fit = lambda rng: fit_mdce_serd(minimum_example, ALWAYS_A, rng=rng, prior=prior)  # noqa: E731
    found = multi_start(fit, 12, np.random.default_rng(0))
    assert found.n_converged == 12
    assert len(found.explanations) == 2
    signs = {float(np.sign(one.fit.reward_weights[0])) for one in found.explanations}
    assert signs == {-1.0, 1.0}
    assert sorted(start for one in found.explanations for start in one.starts) == list(range(12))
    assert found.best.objective == max(fit.objective for fit in found.fits)


def test_the_open_scale_of_policy_matching_makes_no_second_explanation(minimum_example):
    """Rewards and temperature ten times as large choose alike."""
    prior = GaussianPrior(2.0, Block.REWARD) + GaussianPrior(0.1, Block.POLICY, 1.0)
    one = fit_pm_serd(
        minimum_example, ALWAYS_A, initial_weights=np.ones(1), prior=prior + DirichletPrior(1.0)
    )
    ten_times = one.parameters.with_block(Block.REWARD, 10 * one.reward_weights)
    large = replace(one, parameters=ten_times, temperature=10 * one.temperature)
    other = replace(one, parameters=ten_times)
    for fit, n_explanations in ((large, 1), (other, 2)):
        fits = iter((one, fit))
        found = multi_start(lambda _, fits=fits: next(fits), 2, np.random.default_rng(0))
        assert len(found.explanations) == n_explanations


def test_no_other_step_of_the_fit_explains_the_validation_set_better(make_gridworld):
    case = make_gridworld(side=5, n_episodes=12, n_steps=8)
    training, validation = split_episodes(case.decisions, 0.5, np.random.default_rng(0))
    problem, policy, scores = case.problem, MdcePolicy(), []
    start = {"initial_weights": np.array([-4.0, 9.0])}
    start["dynamics"] = estimate_dynamics(problem, training)
    fit = fit_serd_with_early_stopping(problem, training, validation, policy, patience=15, **start)
    score = validation_score(problem, validation, policy, TiedBelief(), fit.parameters)
    keep = lambda step: scores.append(score(step.vector))  # noqa: E731
    fit_mdce_serd(problem, training, prior=UniformPrior(), on_step=keep, **start)
    reached = validation_log_likelihood(problem, validation, fit)
    assert reached == pytest.approx(max(scores[: fit.n_steps + 15]), abs=1e-6)
    assert reached > scores[-1]
    assert not fit.converged
    assert fit.message.startswith("stopped early")
