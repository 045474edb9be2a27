"""What decisions that take time inform about, and standard errors of their fits."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
import scipy.special
import scipy.stats

import serd_core as sc
from serd_core.demonstrations.observations import observe
from serd_core.policies.solved_policy import MdcePolicy
from serd_core.posterior.posterior import Posterior
from serd_core.priors.prior import UniformPrior
from serd_core.semi_markov.dwell_likelihood import DwellPrior
from serd_core.semi_markov.gamma_law import fisher_information, log_density
from tests.support import semi_markov as rings
from tests.support.small_problems import PROPER

PRIOR = PROPER + DwellPrior(1.0)


@pytest.fixture(scope="module")
def learned():
    timed, truth = rings.timed_ring()
    rng = np.random.default_rng(11)
    decisions = rings.demonstrations(timed, truth, rng, n_episodes=30, starts=np.arange(4, 8))
    fit = sc.fit_mdce_serd(timed, decisions, initial_weights=np.ones(2), prior=PRIOR)
    return timed, decisions, fit, sc.laplace(timed, decisions, fit)


@pytest.fixture(scope="module")
def known(learned):
    return sc.outcome_information(learned[3])


def test_dwell_times_inform_by_the_divergence_of_a_law_by_quadrature():
    """One law of all moves, which choices say nothing about: rewards weigh nothing."""
    timed = sc.semi_markov_problem(rings.ring(), law_of=np.zeros((3, 3), dtype=np.int64))
    truth = timed.mdp.transitions.parameters_from(rings.OUTCOMES, 1.6, 5.0)
    decisions = rings.demonstrations(timed, truth, np.random.default_rng(5), until_command_s=1e6)
    decisions = decisions.select(np.arange(25))
    prior = sc.GaussianPrior(1e-4, sc.Block.REWARD) + sc.DirichletPrior(0.7) + DwellPrior(1.0)
    fit = sc.fit_mdce_serd(timed, decisions, initial_weights=np.zeros(2), prior=prior)
    found = sc.laplace(timed, decisions, fit)
    laws = sc.dwell_summary(found, sc.laplace_draws(found, np.random.default_rng(6), 600))
    log_mean, log_shape = np.linspace(-0.5, 1.5, 400), np.linspace(-1.0, 4.0, 300)
    a, scale = np.exp(log_shape), np.exp(log_mean[:, None] - log_shape)
    dwell_s = decisions.dwell_s
    logs = (a - 1.0) * np.log(dwell_s).sum() - dwell_s.sum() / scale
    logs -= 25.0 * (scipy.special.gammaln(a) + a * np.log(scale))
    wide = scipy.stats.norm(0.0, np.sqrt(10.0))
    logs += wide.logpdf(log_mean)[:, None]
    logs += scipy.stats.norm(np.log(4.0), 1.0).logpdf(log_shape)
    density = scipy.integrate.trapezoid(np.exp(logs - logs.max()), log_shape, axis=1)
    density /= scipy.integrate.trapezoid(density, log_mean)
    terms = density * (np.log(np.maximum(density, 1e-300)) - wide.logpdf(log_mean))
    divergence = scipy.integrate.trapezoid(terms, log_mean)
    assert laws.n_dwells.tolist() == [25.0]
    assert laws.from_dwells[0] == pytest.approx(divergence, rel=0.02)
    assert laws.from_choices[0] < 0.05
    assert laws.source(0) == "dwell times"
    mass = scipy.integrate.cumulative_trapezoid(density, log_mean, initial=0.0)
    expected = np.exp(np.interp([0.05, 0.5, 0.95], mass, log_mean))
    np.testing.assert_allclose(laws.mean_interval_s[:, 0], expected, rtol=0.03)
    np.testing.assert_array_equal(laws.weight_correlation.shape, (2, 1))


def test_of_an_avoided_move_choices_inform_and_its_own_dwell_times_cannot(learned, known):
    timed, decisions, _, found = learned
    laws = sc.dwell_summary(found, known.draws)
    assert laws.n_chosen[rings.AGAINST] == laws.n_dwells[rings.AGAINST] == 0
    assert laws.from_dwells[rings.AGAINST] == pytest.approx(0.0, abs=1e-12)
    assert laws.from_choices[rings.AGAINST] > 0.2
    assert laws.source(rings.AGAINST) == "choices"
    assert laws.source(rings.WITH) == "dwell times"
    np.testing.assert_array_equal(laws.n_dwells, np.bincount(decisions.action, minlength=3))
    # Slow and unlikely moves are avoided alike.
    assert laws.mean_interval_s[0, rings.AGAINST] < 3.0 < laws.mean_interval_s[2, rings.AGAINST]
    log_mean = known.draws.truth[:, timed.mdp.transitions.means][:, rings.AGAINST]
    forward = timed.mdp.transitions.moves.local_probabilities(known.draws.truth)[
        :, rings.AGAINST, 0
    ]
    expected = np.quantile(log_mean - np.log(forward), [0.05, 0.5, 0.95])
    np.testing.assert_allclose(laws.log_mean_over_probability[:, rings.AGAINST, 0], expected)
    expected = np.corrcoef(known.draws.reward[:, 1], log_mean)[0, 1]
    assert laws.weight_correlation[1, rings.AGAINST] == pytest.approx(expected)


def test_the_information_of_a_gamma_law_is_the_expected_curvature():
    log_mean, log_shape = 0.3, np.log(3.7)
    law = scipy.stats.gamma(3.7, scale=np.exp(log_mean) / 3.7)

    def expected(name: str) -> float:
        def integrand(t: float) -> float:
            found = log_density(np.array([np.log(t)]), np.array([log_mean]), np.array([log_shape]))
            return -float(getattr(found, name)[0]) * law.pdf(t)

        return scipy.integrate.quad(integrand, 0.0, 20.0)[0]

    by_mean, by_shape = fisher_information(np.array([log_shape]))
    assert by_mean[0] == pytest.approx(expected("mean_mean"), rel=1e-7)
    assert by_shape[0] == pytest.approx(expected("shape_shape"), rel=1e-7)
    assert expected("mean_shape") == pytest.approx(0.0, abs=1e-7)


def test_the_gain_is_that_of_the_scores_of_sampled_demonstrations():
    """A naive twin, with the scores of choices, moves and dwell times."""
    timed, truth = rings.timed_ring("and patience")
    decisions = rings.demonstrations(timed, truth, np.random.default_rng(3), until_command_s=1e6)
    fit = sc.fit_mdce_serd(timed, decisions)
    found = sc.laplace(timed, decisions, fit)
    start, length, n_episodes = 9, 5, 8000
    table = timed.mdp.transitions.local_probabilities(fit.parameters.truth)
    policy = sc.soft_policy(timed, fit.reward_weights, table).probabilities
    size = {"n_episodes": n_episodes, "n_steps": length, "rng": np.random.default_rng(4)}
    at, starts = fit.parameters.truth, np.eye(rings.PLACES)[start]
    drawn = sc.sample_timed_decisions(timed.mdp, policy, at, starts, **size)
    outer = sc.fit_information(timed, drawn, fit).outer_product / n_episodes
    root = found.coordinates.table @ found.root
    added = root.T @ outer @ root
    expected = 0.5 * np.linalg.slogdet(np.eye(len(added)) + added)[1]
    gain = sc.expected_information_gain(found, longest=length)
    assert gain[start] == pytest.approx(expected, rel=0.05)
    assert gain[rings.GOAL] == 0.0


@pytest.fixture(scope="module", params=rings.CASES)
def fitted(request):
    laws, paced = request.param
    rng = np.random.default_rng(7)
    timed, truth = rings.timed_ring(laws, rng.normal(0.0, 0.3, rings.PLACES) if paced else None)
    decisions = rings.demonstrations(timed, truth, rng, n_episodes=6)
    hidden = np.arange(len(decisions)) % 7 == 3
    decisions = replace(decisions, action=np.where(hidden, -1, decisions.action))
    start = timed.mdp.transitions.parameters_from(rings.OUTCOMES, 1.3, 3.0)
    return timed, decisions, sc.fit_mdce_serd(timed, decisions, dynamics=start)


def test_the_outer_product_is_that_of_the_gradients_of_single_decisions(fitted):
    timed, decisions, fit = fitted
    assert decisions.censored[~decisions.hidden].any()
    total = 0.0
    for place in range(len(decisions)):
        one = observe(timed, decisions.select([place]))
        at = Posterior(timed, one, MdcePolicy(), UniformPrior()).evaluate(fit.parameters)
        score = sc.TiedBelief().pull_back(at.gradient, fit.parameters)
        total = total + np.outer(score, score)
    information = sc.fit_information(timed, decisions, fit)
    np.testing.assert_allclose(information.outer_product, total, atol=1e-8 * np.abs(total).max())
    assert information.n_decisions == len(decisions) - np.sum(decisions.censored & decisions.hidden)
    shown = decisions.select(~decisions.hidden)
    information = sc.fit_information(timed, shown, fit)
    each = sc.clustered_outer_product(timed, information, shown, np.arange(len(shown)))
    factor = len(shown) / (len(shown) - 1)
    np.testing.assert_allclose(each, factor * information.outer_product, atol=1e-8 * each.max())


def test_a_fit_of_rewards_alone_knows_nothing_of_dwell_times(learned):
    timed, decisions, _, _ = learned
    fit = sc.fit_mdce_serd(timed, decisions, belief=sc.FixedBelief())
    found = sc.laplace(timed, decisions, fit)
    draws = sc.laplace_draws(found, np.random.default_rng(0), 8)
    with pytest.raises(sc.SerdError, match="must have learned outcome models, got one of rewards"):
        sc.dwell_summary(found, draws)
    with pytest.raises(sc.SerdError, match="problem must have dwell times, got transitions of"):
        sc.dwell_summary(
            replace(found, posterior=replace(found.posterior, problem=rings.ring())), draws
        )
