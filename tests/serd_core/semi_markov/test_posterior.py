"""Gradient, Hessian and fits of rewards, outcomes and dwell times together."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import gamma

import serd_core as sc
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.observations import observe
from serd_core.learners.start import starting_parameters
from serd_core.policies.policy_model import MdcePolicy
from serd_core.posterior.coordinates import LogPosterior, coordinates
from serd_core.posterior.parameters import Parameters
from serd_core.posterior.posterior import Posterior
from tests.serd_core.semi_markov.test_models import differences
from tests.support.semi_markov import (
    AGAINST,
    LAWS,
    OUTCOMES,
    PLACES,
    WEIGHTS,
    demonstrations,
    ring,
    timed_ring,
)

BELIEFS = [sc.TiedBelief(), sc.FreeBelief(), sc.BeliefAroundTruth(1.0), sc.FixedBelief()]


@pytest.fixture(scope="module", params=[(laws, paced) for laws in LAWS for paced in (False, True)])
def seen(request):
    laws, paced = request.param
    rng = np.random.default_rng(7)
    pace = rng.normal(0.0, 0.3, PLACES) if paced else None
    timed, truth = timed_ring(laws, pace)
    return timed, truth, demonstrations(timed, truth, rng)


def test_the_likelihood_of_dwell_times_has_the_derivatives_of_differences(seen):
    timed, truth, decisions = seen
    dwells = observe(timed.mdp, decisions).dwells
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
    model, dwells = timed.mdp.transitions, observe(timed.mdp, decisions).dwells
    laws, by_decision = (
        model.laws(truth),
        dict(zip(dwells.row.tolist(), dwells.by_decision(truth), strict=True)),
    )
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


@pytest.mark.parametrize("belief", BELIEFS, ids=lambda belief: type(belief).__name__)
def test_gradient_and_hessian_are_those_of_differences(seen, belief):
    timed, truth, decisions = seen
    rng = np.random.default_rng(9)
    strengths = PriorByEvidence(2.0, 1.3, 0.8).strengths(belief, timed=True)
    prior = strengths.whole_prior(timed, np.zeros(0))
    posterior = Posterior(timed, observe(timed.mdp, decisions), MdcePolicy(), prior)
    at = truth + rng.normal(0.0, 0.2, len(truth))
    start = starting_parameters(timed, MdcePolicy(), WEIGHTS, at, belief)
    space = coordinates(timed, belief, start)
    objective = LogPosterior(posterior, space)
    u = space.of(start) + rng.normal(0.0, 0.05, space.table.shape[1])
    gradient = objective.evaluate(u)[1]
    size = np.abs(gradient).max()
    expected = differences(lambda point: objective.evaluate(point)[0], u)
    np.testing.assert_allclose(gradient, expected, atol=1e-8 * size)
    hessian = objective.hessian(u)
    expected = differences(lambda point: objective.evaluate(point)[1], u)
    np.testing.assert_allclose(hessian, expected, atol=1e-7 * np.abs(hessian).max())


@pytest.mark.parametrize("belief", BELIEFS[:3], ids=lambda belief: type(belief).__name__)
def test_where_every_move_takes_one_second_fits_are_those_without_time(belief):
    rng = np.random.default_rng(10)
    plain = ring()
    policy = sc.soft_policy(plain, WEIGHTS, OUTCOMES).probabilities
    decisions = sc.sample_decisions(plain.mdp, policy, OUTCOMES, n_episodes=8, n_steps=30, rng=rng)
    timed = sc.semi_markov_problem(plain, law_of=np.full((3, 3), -1))
    beside = rng.normal(0.0, 0.3, 9)
    at = [
        Posterior(each, observe(each.mdp, decisions), MdcePolicy(), sc.UniformPrior()).evaluate(
            Parameters(WEIGHTS, beside, -beside, np.zeros(0))
        )
        for each in (plain, timed)
    ]
    assert at[0].objective == at[1].objective
    assert np.array_equal(at[0].gradient.vector, at[1].gradient.vector)
    one, other = (sc.fit_mdce_serd(each, decisions, belief=belief) for each in (plain, timed))
    np.testing.assert_allclose(one.parameters.vector, other.parameters.vector, rtol=0, atol=1e-12)
    assert one.objective == pytest.approx(other.objective, abs=1e-12)
    for each in ("outcome_probabilities", "believed_outcome_probabilities"):
        np.testing.assert_allclose(getattr(one, each), getattr(other, each), rtol=0, atol=1e-12)
    first, second = (
        sc.laplace(*pair) for pair in ((plain, decisions, one), (timed, decisions, other))
    )
    assert first.log_evidence == pytest.approx(second.log_evidence, abs=1e-12)
    drawn = [found.sample(6, np.random.default_rng(1)) for found in (first, second)]
    np.testing.assert_allclose(drawn[0], drawn[1], rtol=0, atol=1e-12)


def test_laws_of_one_exact_second_give_the_policy_without_time():
    plain = ring()
    timed = sc.semi_markov_problem(plain)
    exact = timed.mdp.transitions.parameters_from(OUTCOMES, np.ones(3), 1e15)
    table = timed.mdp.transitions.local_probabilities(exact)
    one = sc.soft_policy(plain, WEIGHTS, OUTCOMES)
    np.testing.assert_allclose(sc.soft_policy(timed, WEIGHTS, table).q, one.q, rtol=1e-12)


@pytest.fixture(scope="module")
def learned():
    rng = np.random.default_rng(11)
    timed, truth = timed_ring()
    starts = np.arange(4, 8)
    decisions = demonstrations(timed, truth, rng, n_episodes=60, starts=starts)
    return timed, truth, decisions, sc.fit_mdce_serd(timed, decisions)


def test_durations_of_avoided_moves_are_learned_from_choices(learned):
    timed, truth, decisions, fit = learned
    model = timed.mdp.transitions
    counted = sc.estimate_dynamics(timed, decisions)
    assert fit.converged
    place = model.means.start + AGAINST
    found = sc.laplace(timed, decisions, fit)
    laws = sc.dwell_summary(found, sc.laplace_draws(found, np.random.default_rng(1), 200), 0.99)
    assert laws.n_chosen[AGAINST] < 0.3 * laws.n_chosen[0]
    low, _, high = np.log(laws.mean_interval_s)
    assert np.all((low < truth[model.means]) & (truth[model.means] < high))
    assert np.abs(counted[place] - truth[place]) < 2.0
    seen = observe(timed.mdp, decisions)
    of_moves = np.sum(
        seen.group_count
        * np.log(seen.probabilities(model.moves.local_probabilities(fit.parameters.truth)))
    )
    of_dwells = seen.dwells.evaluate(fit.parameters.truth)[0]
    assert fit.dynamics_log_likelihood == pytest.approx(of_moves + of_dwells, rel=1e-12)
    parts = fit.policy_log_likelihood + fit.dynamics_log_likelihood + fit.log_prior
    assert fit.objective == pytest.approx(parts, rel=1e-12)


def test_sweeps_draw_from_the_posterior_of_durations():
    """Importance weights of draws with wider tails, which hold for any density, agree."""
    rng = np.random.default_rng(12)
    plain = ring(n_outcomes=1)
    timed = sc.semi_markov_problem(sc.TabularProblem(plain.mdp, plain.features[..., :1], ("goal",)))
    truth = timed.mdp.transitions.parameters_from(np.ones((3, 1)), np.array([1.0, 3.0, 0.8]), 5.0)
    decisions = demonstrations(timed, truth, rng, n_episodes=10, starts=np.arange(4, 8))
    fit = sc.fit_mdce_serd(timed, decisions)
    found = sc.laplace(timed, decisions, fit)
    swept = found.sample(320, rng)
    objective, size, tails = LogPosterior(found.posterior, found.coordinates), len(found.mode), 5.0
    # Where nobody goes the posterior has a long tail towards slow moves.
    place = size - 2 * timed.mdp.transitions.n_laws + AGAINST
    covariance, centre = found.root @ found.root.T, found.mode.copy()
    covariance[place, place] += 0.8**2
    centre[place] += 0.6
    away = rng.standard_normal((2500, size)) / np.sqrt(rng.chisquare(tails, (2500, 1)) / tails)
    points = centre + away @ np.linalg.cholesky(covariance).T
    logs = np.array([objective.evaluate(point)[0] for point in points])
    logs += 0.5 * (tails + size) * np.log1p(np.sum(away**2, axis=1) / tails)
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    assert 1.0 / np.sum(weights**2) > 400.0
    mean = weights @ points
    spread = np.sqrt(weights @ (points - mean) ** 2)
    assert spread[place] > 1.5 * np.linalg.norm(found.root[place])
    np.testing.assert_array_less(np.abs(swept.mean(axis=0) - mean) / spread, 0.4)
    np.testing.assert_allclose(swept.std(axis=0) / spread, 1.0, atol=0.35)


def test_robots_plan_with_the_mean_of_discounted_outcomes(learned):
    timed, _, decisions, fit = learned
    found = sc.laplace(timed, decisions, fit)
    draws = sc.dynamics_draws(found, np.random.default_rng(13), n=8)
    table = sc.mean_discounted_outcomes(timed, draws)
    swept = sc.laplace_draws(found, np.random.default_rng(13), n=8)
    np.testing.assert_allclose(table, swept.outcome_probabilities.mean(axis=0), rtol=1e-13)
    laws = timed.mdp.transitions.laws(draws)
    shape = np.where(np.isfinite(laws.shape), laws.shape, 1.0)
    kernel = laws.probability * (1.0 - laws.mean_s / shape * np.log(0.97)) ** -shape
    has_law = np.isfinite(laws.shape[0])
    np.testing.assert_allclose(0.97 * table[has_law], kernel.mean(axis=0)[has_law], rtol=1e-12)
    robot = sc.optimal_policy(timed, fit.reward_weights, table)
    assert robot.converged
    assert robot.greedy[10] == 0


def test_a_posterior_needs_a_density_of_dwell_times(learned):
    timed, _, decisions, fit = learned
    prior = sc.GaussianPrior(6.0, sc.Block.REWARD) + sc.DirichletPrior(1.0)
    without = replace(fit, assumptions=replace(fit.assumptions, prior=prior))
    with pytest.raises(
        sc.SerdError, match="dwell times of the block belief or truth too, got none"
    ):
        sc.laplace(timed, decisions, without)


def test_a_belief_of_its_own_has_durations_of_its_own():
    rng = np.random.default_rng(14)
    timed, truth = timed_ring()
    model = timed.mdp.transitions
    believed = truth.copy()
    believed[model.means.start + AGAINST] += 1.2
    share = np.zeros(PLACES)
    share[1:6] = 0.2
    policy = sc.soft_policy(timed, WEIGHTS, model.local_probabilities(believed)).probabilities
    decisions = sc.sample_timed_decisions(
        timed.mdp, policy, truth, share, n_episodes=80, n_steps=60, rng=rng
    )
    fit = sc.fit_mdce_serd(timed, decisions, belief=sc.FreeBelief())
    place = model.means.start + AGAINST
    assert fit.converged
    assert abs(fit.parameters.truth[place] - truth[place]) < 0.2
    assert fit.parameters.belief[place] - fit.parameters.truth[place] > 0.5


def test_a_finite_horizon_needs_moves_without_time(learned):
    timed = learned[0]
    with pytest.raises(sc.SerdError, match="to get a finite horizon, got SemiMarkovModels"):
        sc.finite_horizon(timed, 5)


def test_hidden_actions_are_validated_by_outcome_probabilities(learned):
    timed, _, decisions, fit = learned
    hidden = decisions.select(~decisions.censored).with_hidden_actions()
    policy = sc.fitted_policy(timed, fit)
    discounted = timed.mdp.transitions.local_probabilities(fit.parameters.belief)
    expert = sc.soft_policy(timed, fit.reward_weights, discounted)
    np.testing.assert_array_equal(policy, expert.probabilities)
    table = timed.mdp.transitions.laws(fit.parameters.truth).probability
    each = sc.move_log_likelihood(timed, hidden, policy, table)
    assert sc.validation_log_likelihood(timed, hidden, fit) == pytest.approx(each.mean())
