"""Swept draws against closed forms, and against brute-force integration of tiny posteriors."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.integrate
import scipy.special
import scipy.stats

import serd_core as sc
from serd_core.bayes import laplace as laplace_module
from serd_core.bayes import surrogate as surrogate_module
from serd_core.bayes.hyperpriors import Scales
from serd_core.bayes.mixing import effective_sizes
from serd_core.bayes.surrogate import Surrogate
from serd_core.bayes.sweeps import can_sweep
from support.small_problems import apart, sampled

N_CELLS = 6


def one_way(places):
    """A ring of cells with one action; outcome k leads `places[k]` cells ahead. No choices.

    The decisions are ten episodes of a robot that mostly takes the first outcome. The model intends
    the last one.
    """
    cells, shape = np.arange(N_CELLS), (N_CELLS, 1)
    successors = (cells[:, None, None] + np.array(places)) % N_CELLS
    model_of, available = np.zeros(shape, int), np.ones(shape, bool)
    models = sc.OutcomeModels(successors, model_of, available, 1, intended=[len(places) - 1])
    problem = sc.TabularProblem(sc.Mdp(models, 0.9), np.ones((*shape, 1)), ("one",))
    rest = len(places) - 1
    table = np.array([[0.9] + [0.1 / rest] * rest])
    return problem, sampled(problem, np.ones(shape), table, 10, 20)


def fitted(problem, decisions, **prior):
    fit = sc.fit_mdce_serd(problem, decisions, prior=sc.PriorByEvidence(**prior))
    return sc.laplace(problem, decisions, fit)


@pytest.mark.parametrize(
    ("places", "pseudo_count", "ratio"),
    [
        ([1, 0, 0], 0.3, 1.0),
        ([1, 0, 0, 0, 0], 1.0, 1.0),
        ([1, 0, 1, 0], 0.3, 6.0),
        ([1, 0, 0, 2], 1.0, 3.0),
    ],
    ids=str,
)
def test_what_is_identified_has_its_beta_posterior_and_what_is_not_keeps_its_prior(
    places, pseudo_count, ratio
):
    problem, decisions = one_way(places)
    found = fitted(problem, decisions, pseudo_count=pseudo_count, intended_ratio=ratio)
    counts = pseudo_count * np.array([1.0] * (len(places) - 1) + [ratio])
    draws = sc.laplace_draws(found, np.random.default_rng(1), 9000)
    table = draws.outcome_probabilities[:, 0]
    ahead = (decisions.next_state - decisions.state) % N_CELLS
    for place in set(places):
        mine = np.array(places) == place
        a = np.sum(ahead == place) + counts[mine].sum()
        exact = scipy.stats.beta(a, len(decisions) + counts.sum() - a)
        total = table[:, mine].sum(axis=1)
        assert total.std() == pytest.approx(exact.std(), rel=0.06)
        assert np.quantile(total, [0.05, 0.95]) == pytest.approx(
            exact.ppf([0.05, 0.95]), abs=0.12 * exact.std()
        )
        assert scipy.stats.kstest(total, exact.cdf).pvalue > 1e-3
        if mine.sum() > 1:
            share = table[:, mine][:, 0] / total
            unseen = scipy.stats.beta(counts[mine][0], counts[mine][1:].sum())
            # Counts are split by the last shares, so the states of a chain are correlated.
            assert share.mean() == pytest.approx(unseen.mean(), abs=0.2 * unseen.std())
            assert share.std() == pytest.approx(unseen.std(), rel=0.1)


C, SIGMA = 1.5, 1.0
REWARDS = sc.GaussianPrior(SIGMA, sc.Block.REWARD)


def two_states():
    """A model of outcomes, change or stay twice, applies to the first action; the second one waits.

    Who likes it in state 1 takes the first action in state 0, and there the more often the likelier
    it is to change.
    """
    successors = np.repeat(np.arange(2)[:, None, None], 3, axis=2)
    successors = np.repeat(successors, 2, axis=1)
    successors[[0, 1], 0, 0] = [1, 0]
    models = sc.OutcomeModels(successors, [[0, 1], [0, 1]], np.ones((2, 2), bool), 2)
    features = np.array([[[0.0], [0.2]], [[1.0], [1.2]]])
    problem = sc.TabularProblem(sc.Mdp(models, 0.8), features, ("there",))
    state, action = np.repeat([[0, 0, 1, 1], [0, 1, 0, 1]], [9, 5, 4, 6], axis=1)
    following = state.copy()
    following[:3], following[14:17] = 1, 0
    return problem, apart(state, action, following)


N_CHANGED, N_STAYED = 6, 7
WEIGHTS, LOGITS = np.linspace(-4.5, 4.5, 41), np.linspace(-8.0, 8.0, 41)


@cache
def log_choices():
    """(41, 41) log likelihood of the choices over weights and log odds of a change."""
    problem, decisions = two_states()
    p = scipy.special.expit(LOGITS)
    found = np.zeros((len(WEIGHTS), len(LOGITS)))
    uniform = np.full(3, 1.0 / 3.0)
    for j, change in enumerate(p):
        table = np.array([[change] + [(1.0 - change) / 2.0] * 2, uniform])
        for i, weight in enumerate(WEIGHTS):
            policy = sc.soft_policy(problem, [weight], table).probabilities
            found[i, j] = np.sum(np.log(policy[decisions.state, decisions.action]))
    return found


def log_beta_density(a, b):
    """(41,) of the log odds, up to a constant."""
    return -a * np.log1p(np.exp(-LOGITS)) - b * np.log1p(np.exp(LOGITS))


def exact_marginals(belief):
    """Probabilities of the grid's weights, and of its log odds believed and true."""
    choices = log_choices() - 0.5 * (WEIGHTS[:, None] / SIGMA) ** 2
    counted = log_beta_density(N_CHANGED + C, N_STAYED + 2 * C)
    if belief == sc.TiedBelief():
        joint = choices[:, :, None] + np.where(np.eye(len(LOGITS), dtype=bool), counted, -np.inf)
    else:
        joint = choices[:, :, None] + log_beta_density(C, 2 * C)[:, None] + counted
    density = np.exp(joint - joint.max())
    density /= density.sum()
    return {
        "weight": density.sum(axis=(1, 2)),
        "believed": density.sum(axis=(0, 2)),
        "true": density.sum(axis=(0, 1)),
        "together": np.einsum("ijk,i,j->", density, WEIGHTS, LOGITS),
    }


def require_marginal(found, grid, density):
    """The draws have mean, deviation and quantiles of a density on a grid."""
    mean = density @ grid
    deviation = np.sqrt(density @ (grid - mean) ** 2)
    assert found.mean() == pytest.approx(mean, abs=0.1 * deviation)
    assert found.std() == pytest.approx(deviation, rel=0.08)
    ends = grid + (grid[1] - grid[0]) / 2
    below = np.searchsorted(np.sort(found), ends) / len(found)
    np.testing.assert_allclose(below, np.cumsum(density), atol=0.05)


@pytest.mark.parametrize("belief", [sc.TiedBelief(), sc.FreeBelief()], ids=repr)
def test_sweeps_keep_the_posterior_of_choices_and_moves(belief):
    """Against the sum over a grid of weights and log odds."""
    problem, decisions = two_states()
    prior = REWARDS + sc.DirichletPrior(C)
    if belief == sc.FreeBelief():
        prior = prior + sc.DirichletPrior(C, sc.Block.BELIEF)
    start = {"initial_weights": np.ones(1), "belief": belief, "prior": prior}
    found = sc.laplace(problem, decisions, sc.fit_mdce_serd(problem, decisions, **start))
    rng = np.random.default_rng(0)
    assert can_sweep(found.posterior, found.coordinates)
    draws = sc.laplace_draws(found, rng, 12800)
    exact = exact_marginals(belief)
    believed = scipy.special.logit(draws.believed_outcome_probabilities[:, 0, 0])
    weights = draws.reward[:, 0]
    require_marginal(weights, WEIGHTS, exact["weight"])
    require_marginal(believed, LOGITS, exact["believed"])
    true = scipy.special.logit(draws.outcome_probabilities[:, 0, 0])
    require_marginal(true, LOGITS, exact["true"])
    scale = weights.std() * believed.std()
    assert np.mean(weights * believed) == pytest.approx(exact["together"], abs=0.1 * scale)


def test_draws_of_hidden_actions_are_those_of_the_sum_over_the_actions():
    """Two actions, each with its model, lead on or not; discount 0 makes choices logistic."""
    successors = np.array([[[1, 0], [1, 0]], [[1, 1], [1, 1]]])
    models = sc.OutcomeModels(successors, [[0, 1], [0, 1]], np.ones((2, 2), bool), 2)
    features = np.array([[[1.0], [0.0]], [[0.0], [0.0]]])
    problem = sc.TabularProblem(sc.Mdp(models, 0.0), features, ("first",))
    shown, hidden = [(0, 1, 4), (0, 0, 1), (1, 1, 1), (1, 0, 2)], [(1, 9), (0, 4)]
    rows = [(a, s) for a, s, n in shown for _ in range(n)]
    rows += [(-1, s) for s, n in hidden for _ in range(n)]
    decisions = apart(0, *np.array(rows).T)
    start = {"initial_weights": np.zeros(1), "dynamics": np.array([[0.7, 0.3], [0.4, 0.6]])}
    fit = sc.fit_mdce_serd(problem, decisions, prior=REWARDS + sc.DirichletPrior(C), **start)
    found = sc.laplace(problem, decisions, fit)
    draws = sc.laplace_draws(found, np.random.default_rng(0), 6400)
    grid = np.linspace(-6.0, 6.0, 61)
    share = scipy.special.expit(grid)
    w, first, second = share[:, None, None], share[:, None], share
    joint = -0.5 * (grid[:, None, None] / SIGMA) ** 2
    joint = joint + C * (np.log(first * (1 - first)) + np.log(second * (1 - second)))
    for a, s, count in shown:
        chosen, leads = (w, first) if a == 0 else (1 - w, second)
        joint = joint + count * np.log(chosen * (leads if s else 1 - leads))
    on = w * first + (1 - w) * second
    joint = joint + hidden[0][1] * np.log(on) + hidden[1][1] * np.log(1 - on)
    density = np.exp(joint - joint.max())
    density /= density.sum()
    require_marginal(draws.reward[:, 0], grid, density.sum(axis=(1, 2)))
    odds = scipy.special.logit(draws.outcome_probabilities[:, :, 0])
    require_marginal(odds[:, 0], grid, density.sum(axis=(0, 2)))
    require_marginal(odds[:, 1], grid, density.sum(axis=(0, 1)))


@pytest.mark.parametrize("n_copies", [2, 5])
def test_points_that_are_solved_together_have_the_policy_of_each(gridworld, monkeypatch, n_copies):
    monkeypatch.setattr(surrogate_module, "STACKED", n_copies * 25)
    found = fitted(gridworld.problem, gridworld.decisions)
    near = surrogate_module.surrogate(found.posterior, found.coordinates, found.mode, 5)
    assert near.copies.n_states == n_copies * 25
    points = found.sample(5, np.random.default_rng(0)) @ found.coordinates.table.T
    together = near.exact(points, np.tile(near.value, (5, 1)))
    for number, point in enumerate(points):
        parameters = found.coordinates.belief.unpack(point, found.coordinates.like)
        _, _, solution, log_policy = found.posterior.solved(parameters)
        np.testing.assert_allclose(
            together.log_policy[number], log_policy.ravel()[near.pairs], atol=1e-6
        )
        np.testing.assert_allclose(together.values[number], solution.value, rtol=1e-6)


def test_the_linear_q_function_has_the_value_and_the_slope_at_the_mode(gridworld):
    found = fitted(gridworld.problem, gridworld.decisions)
    near = surrogate_module.surrogate(found.posterior, found.coordinates, found.mode, 2)
    step = 1e-4 * found.coordinates.table @ np.random.default_rng(0).normal(size=len(found.mode))
    points = np.stack([near.mode + step, near.mode - step])
    exact = near.exact(points, np.tile(near.value, (2, 1))).log_policy
    linear = near.log_policy(points)
    np.testing.assert_allclose(linear, exact, atol=1e-5)
    np.testing.assert_allclose(linear[0] - linear[1], exact[0] - exact[1], atol=1e-6)


def test_a_seed_gives_the_same_draws_and_another_seed_others():
    found = fitted(*one_way([1, 0, 0]))
    first, same, other = (found.sample(100, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, same)
    assert not np.any(first == other)
    for n in (1, 63, 65):
        assert found.sample(n, np.random.default_rng(0)).shape == (n, len(found.mode))


def test_draws_of_rewards_alone_are_normal_in_pairs_that_mirror_each_other():
    case = one_way([1, 0, 0])
    fit = sc.fit_mdce_irl_by_likelihood(*case, prior=sc.PriorByEvidence())
    alone = sc.laplace(*case, fit)
    assert not can_sweep(alone.posterior, alone.coordinates)
    weights = sc.laplace_draws(alone, np.random.default_rng(0), 100).reward
    mode = alone.coordinates.parameters(alone.mode).reward
    np.testing.assert_allclose(weights[:50] + weights[50:], 2 * mode[None].repeat(50, axis=0))


def autoregressive(n_states, n_chains, keep, rng):
    """Stationary chains with standard normal states whose lag-1 correlations are `keep`."""
    state, found = rng.standard_normal((n_chains, len(keep))), []
    for _ in range(n_states):
        found.append(state)
        noise = rng.standard_normal(state.shape)
        state = keep * state + np.sqrt(1.0 - keep**2) * noise
    return np.concatenate(found)


def test_correlated_states_are_worth_what_their_autocorrelation_leaves_and_drifting_ones_nothing():
    keep, n = np.array([0.0, 0.5, 0.9]), 40 * 200
    draws = autoregressive(40, 200, keep, np.random.default_rng(0))
    worth = effective_sizes(draws, 200, np.array([0.5]))
    # The median's indicators have the autocorrelation 2 / pi arcsin(keep^t).
    lags = np.arange(1, 40)
    seen = 2.0 / np.pi * np.arcsin(keep[:, None] ** lags)
    expected = n / (1.0 + 2.0 * np.sum((1.0 - lags / 40) * seen, axis=1))
    np.testing.assert_allclose(worth, expected, rtol=0.25)
    drifting = draws + 0.02 * np.repeat(np.arange(40), 200)[:, None]
    assert effective_sizes(drifting, 200, np.array([0.05, 0.5]))[0] == 0.0
    assert (effective_sizes(draws, n, np.array([0.5])) == n).all()  # each draw a chain


def test_an_interval_that_has_not_mixed_is_no_number(monkeypatch):
    found = fitted(*one_way([1, 0, 0]))
    draws = laplace_module.interval_draws(found, np.random.default_rng(0))
    assert np.all(np.isfinite(draws.interval(draws.outcome_probabilities)))
    same = replace(draws, n_chains=1)
    assert np.all(np.isnan(same.interval(draws.outcome_probabilities)))
    monkeypatch.setattr(laplace_module, "EFFECTIVE", np.inf)
    longest = laplace_module.interval_draws(found, np.random.default_rng(0))
    assert len(longest) == laplace_module.N_CHAINS * laplace_module.MOST_STATES
    assert np.all(np.isnan(longest.interval(longest.reward)))


def test_scales_that_are_learned_have_the_density_of_their_mixture():
    found = Scales(np.array([2.0])).log_density(np.array([[0.0], [1.5], [-40.0]]))
    exact = []
    for weight in (0.0, 1.5, -40.0):
        integrand = lambda z, w=weight: (  # noqa: E731
            scipy.stats.norm.pdf(2 * w, scale=3 * np.exp(0.7 * z)) * scipy.stats.norm.pdf(z)
        )
        exact.append(np.log(scipy.integrate.quad(integrand, -9, 9, points=[0, 3])[0]))
    np.testing.assert_allclose(found - found[0], np.array(exact) - exact[0], atol=0.02)


def test_a_base_measure_that_is_sampled_is_the_posterior_by_quadrature():
    """Two models of two outcomes; of the second no move was seen, so it has its base measure."""
    successors = np.zeros((2, 2, 2), int)
    successors[0], successors[1] = [0, 1], [1, 1]
    available = np.array([[True, True], [True, False]])
    models = sc.OutcomeModels(successors, [[0, 1], [0, 1]], available, 2)
    problem = sc.TabularProblem(sc.Mdp(models, 0.0), np.zeros((2, 2, 1)), ("none",))
    decisions = apart(0, 0, np.repeat([0, 1], [12, 1]))
    fit = sc.fit_mdce_serd(problem, decisions, prior=sc.PriorByEvidence())
    found = sc.laplace(problem, decisions, fit)
    assert found.open_strengths == ("deviation", "pseudo_count")
    draws = laplace_module.interval_draws(found, np.random.default_rng(0))
    share, log_c = np.linspace(0.005, 0.995, 199)[:, None], np.linspace(-2.5, 2.5, 101)
    first, second = 2 * np.exp(log_c) * share, 2 * np.exp(log_c) * (1 - share)
    log_density = -0.5 * (log_c / 0.5) ** 2
    log_density = log_density + scipy.special.betaln(first + 12, second + 1)
    density = np.exp(log_density - scipy.special.betaln(first, second))
    density /= density.sum()
    unseen = draws.outcome_probabilities[:, 1, 0]
    mean = np.sum(density * share)
    square = np.sum(density * first * (first + 1) / ((first + second) * (first + second + 1)))
    assert unseen.mean() == pytest.approx(mean, abs=0.03)
    assert unseen.std() == pytest.approx(np.sqrt(square - mean**2), abs=0.03)
    counts = draws.pseudo_counts[:, 1]
    assert np.mean(counts[:, 0] / counts.sum(axis=1)) == pytest.approx(mean, abs=0.03)
    seen = draws.outcome_probabilities[:, 0, 0]
    expected = np.sum(density * (first + 12) / (first + second + 13))
    assert seen.mean() == pytest.approx(expected, abs=0.01)


def test_chains_of_which_none_moves_are_no_result(monkeypatch):
    found = fitted(*one_way([1, 0, 0]))
    solve, calls = Surrogate.exact, []

    def always_less(self, points, values):
        calls.append(0)
        at = solve(self, points, values)
        return replace(at, log_others=at.log_others - 1e6 * len(calls))

    monkeypatch.setattr(Surrogate, "exact", always_less)
    with pytest.raises(sc.SerdError, match="none of 200 sweeps was accepted; take a stronger pri"):
        sc.laplace_draws(found, np.random.default_rng(0))
