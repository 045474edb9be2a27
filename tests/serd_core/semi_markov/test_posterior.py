"""Gradient, Hessian and fits of rewards, outcomes and dwell times together."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
from scipy.stats import gamma

import serd_core as sc
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.observations import observe
from serd_core.learners.start import starting_parameters
from serd_core.policies.solved_policy import MdcePolicy
from serd_core.posterior.coordinates import LogPosterior, coordinates
from serd_core.posterior.posterior import Posterior
from serd_core.semi_markov.dwell_likelihood import BLUR, DwellPrior
from tests.serd_core.semi_markov.test_models import differences
from tests.support import semi_markov as rings

BELIEFS = [sc.TiedBelief(), sc.FreeBelief(), sc.FixedBelief()]


def drawn(laws, paced):
    rng = np.random.default_rng(7)
    timed, truth = rings.timed_ring(laws, rng.normal(0.0, 0.3, rings.PLACES) if paced else None)
    return timed, truth, rings.demonstrations(timed, truth, rng, n_episodes=6)


@pytest.fixture(scope="module", params=rings.CASES)
def seen(request):
    return drawn(*request.param)


def test_the_likelihood_of_dwell_times_has_the_derivatives_of_differences(seen):
    timed, truth, decisions = seen
    dwells = observe(timed, decisions).dwells
    assert 0.05 < dwells.censored.mean() < 0.95
    assert np.array_equal(dwells.censored, decisions.censored[dwells.row])
    at = truth + np.random.default_rng(8).normal(0.0, 0.3, len(truth))
    value, gradient = dwells.evaluate(at)
    assert dwells.by_decision(at).sum() == pytest.approx(value, rel=1e-12)
    size = np.abs(gradient).max()
    expected = differences(lambda theta: dwells.evaluate(theta)[0], at)
    np.testing.assert_allclose(gradient, expected, atol=1e-9 * size)
    expected = differences(lambda theta: dwells.evaluate(theta)[1], at)
    np.testing.assert_allclose(dwells.hessian(at), expected, atol=1e-8 * size)


def test_the_likelihood_of_dwell_times_is_that_of_a_sum_over_outcomes(seen):
    timed, truth, decisions = seen
    model, dwells = timed.mdp.transitions, observe(timed, decisions).dwells
    laws, logs = model.laws(truth), dwells.by_decision(truth)
    by_decision = dict(zip(dwells.row.tolist(), logs, strict=True))
    for row in range(len(decisions)):
        number = model.model_of[decisions.state[row], decisions.action[row]]
        censored, dwell_s = decisions.censored[row], decisions.dwell_s[row]
        total = given = 0.0
        for k in range(model.n_outcomes):
            following = model.successors[decisions.state[row], decisions.action[row], k]
            probability, mean_s, shape = (x[number, k] for x in laws)
            if not censored and following != decisions.next_state[row]:
                continue
            given += probability
            if np.isfinite(shape):
                of = gamma.sf if censored else gamma.pdf
                total += probability * of(dwell_s, shape, scale=mean_s / shape)
            else:
                total += probability * (dwell_s <= mean_s if censored else 1.0)
        if row in by_decision:
            assert by_decision[row] == pytest.approx(np.log(total / given), abs=1e-9)
        else:
            # It ended by a given time, which informs no law.
            assert total == pytest.approx(given)


@pytest.mark.parametrize(
    ("case", "belief"), [*zip(rings.CASES, [*BELIEFS[1:], BELIEFS[0]], strict=True)]
)
def test_gradient_and_hessian_are_those_of_differences(case, belief):
    (timed, truth, decisions), rng = drawn(*case), np.random.default_rng(9)
    strengths = PriorByEvidence(2.0, 1.3, 0.8).strengths(belief, timed.mdp.transitions)
    prior = strengths.prior(timed, np.zeros(0))
    posterior = Posterior(timed, observe(timed, decisions), MdcePolicy(), prior)
    at = truth + rng.normal(0.0, 0.2, len(truth))
    start = starting_parameters(timed, MdcePolicy(), rings.WEIGHTS, at, belief)
    space = coordinates(timed, belief, start)
    objective = LogPosterior(posterior, space)
    u = space.of(start) + rng.normal(0.0, 0.05, space.table.shape[1])
    gradient, hessian = objective.evaluate(u)[1], objective.hessian(u)
    expected = differences(lambda point: objective.evaluate(point)[0], u)
    np.testing.assert_allclose(gradient, expected, atol=1e-8 * np.abs(gradient).max())
    expected = differences(lambda point: objective.evaluate(point)[1], u)
    np.testing.assert_allclose(hessian, expected, atol=1e-7 * np.abs(hessian).max())


@pytest.mark.parametrize("belief", [sc.TiedBelief(), sc.FreeBelief()], ids=repr)
def test_where_every_move_takes_one_second_all_is_as_without_time(belief):
    rng, plain = np.random.default_rng(10), rings.ring()
    policy = sc.soft_policy(plain, rings.WEIGHTS, rings.OUTCOMES).probabilities
    decisions = sc.sample_decisions(
        plain.mdp, policy, rings.OUTCOMES, n_episodes=8, n_steps=30, rng=rng
    )
    one, other = (
        results(problem, decisions, belief)
        for problem in (plain, sc.semi_markov_problem(plain, law_of=np.full((3, 3), -1)))
    )
    for expected, found in zip(one, other, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def results(problem, decisions, belief):
    fit = sc.fit_mdce_serd(problem, decisions, belief=belief)
    found, information = (f(problem, decisions, fit) for f in (sc.laplace, sc.fit_information))
    known, errors = sc.outcome_information(found), sc.standard_errors(problem, information)
    of_fit = fit.objective, fit.parameters.vector, fit.outcome_probabilities, errors.reward
    of_draws = found.sample(6, np.random.default_rng(1)), known.from_transitions, known.lower
    more = found.log_evidence, sc.expected_information_gain(found)
    return (*of_fit, *of_draws, *more, information.observed, information.outer_product)


@pytest.fixture(scope="module")
def learned():
    rng = np.random.default_rng(11)
    timed, truth = rings.timed_ring()
    starts = np.arange(4, 8)
    decisions = rings.demonstrations(timed, truth, rng, n_episodes=60, starts=starts)
    return timed, truth, decisions, sc.fit_mdce_serd(timed, decisions)


def test_a_posterior_needs_a_density_of_dwell_times(learned):
    timed, _, decisions, fit = learned
    prior = sc.GaussianPrior(6.0, sc.Block.REWARD) + sc.DirichletPrior(1.0)
    without = replace(fit, assumptions=replace(fit.assumptions, prior=prior))
    with pytest.raises(sc.SerdError, match="dwell times of the block belief or truth too, got no"):
        sc.laplace(timed, decisions, without)


@pytest.mark.parametrize("deviation", [0.3, 1.0])
def test_the_prior_on_dwell_times_is_a_density_whose_means_are_below_the_patience(deviation):
    """By quadrature over two log means; their shapes are normal."""
    law_of = np.array([[0, 0, 0], [1, 1, 1], [-1, -1, -1]])
    timed = sc.semi_markov_problem(rings.ring(), law_of=law_of, stay_s=np.array([4.0, 0.0, 1.0]))
    models, prior = timed.mdp.transitions, DwellPrior(deviation)
    theta = models.parameters_from(rings.OUTCOMES, 1.0, 4.0)
    like = starting_parameters(timed, MdcePolicy(), rings.WEIGHTS, theta, sc.TiedBelief())
    grid = np.linspace(-21.0, 21.0, 281)
    logs = np.array([[value_at(prior, models, like, (a, b)) for b in grid] for a in grid])
    density = np.exp(logs + prior.log_constant(models, like) + np.log(2.0 * np.pi))
    total = scipy.integrate.trapezoid(scipy.integrate.trapezoid(density, grid), grid)
    assert total == pytest.approx(1.0, abs=1e-6)
    of_bounded = scipy.integrate.trapezoid(density, grid, axis=1)
    beyond = grid > np.log(4.0) + 3.0 * BLUR
    assert scipy.integrate.trapezoid(of_bounded[beyond], grid[beyond]) < 1e-4


def value_at(prior, models, like, log_means):
    """Log density at two log means, up to that of the shapes at their medians."""
    theta = like.truth.copy()
    theta[models.means] = log_means
    return prior.of_laws(models, theta)[0]


def test_a_move_that_is_avoided_takes_no_longer_than_a_robot_waits():
    timed, truth = rings.timed_ring("and patience")
    rng = np.random.default_rng(11)
    decisions = rings.demonstrations(timed, truth, rng, n_episodes=30, starts=np.arange(4, 8))
    fit = sc.fit_mdce_serd(timed, decisions)
    draws = sc.laplace_draws(sc.laplace(timed, decisions, fit), np.random.default_rng(1), 400)
    seconds = np.exp(draws.truth[:, timed.mdp.transitions.means])
    assert np.quantile(seconds, 0.95, axis=0).max() < 4.0 * np.exp(2.0 * BLUR)
