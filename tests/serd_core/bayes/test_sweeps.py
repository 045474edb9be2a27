"""Swept draws against closed forms, and against brute-force integration of tiny posteriors."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.special
import scipy.stats

from serd_core.bayes import surrogate as surrogate_module
from serd_core.bayes.belief_comparison import compare_beliefs
from serd_core.bayes.draws import (
    credible_intervals,
    draws_at,
    laplace_draws,
    posterior_modes,
)
from serd_core.bayes.information import outcome_information
from serd_core.bayes.laplace import Laplace, laplace
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.bayes.surrogate import Surrogate
from serd_core.bayes.sweeps import needs_sweeps, swept
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior.beliefs import Belief, BeliefAroundTruth, FreeBelief, TiedBelief
from serd_core.posterior.parameters import Block
from serd_core.priors.dirichlet import DirichletPrior
from serd_core.priors.gaussian import GaussianPrior
from support.small_problems import apart, sampled

N_CELLS = 6


def one_way(places: list[int]) -> TabularProblem:
    """A ring of cells with one action; outcome k leads `places[k]` cells ahead. No choices."""
    cells = np.arange(N_CELLS)
    successors = (cells[:, None, None] + np.array(places)) % N_CELLS
    shape = (N_CELLS, 1)
    models = OutcomeModels(successors, np.zeros(shape, int), np.ones(shape, bool), 1)
    return TabularProblem(Mdp(models, 0.9), np.ones((*shape, 1)), ("one",))


def fitted(problem: TabularProblem, decisions: Decisions, **prior: float) -> Laplace:
    fit = fit_mdce_serd(problem, decisions, prior=PriorByEvidence(**prior))
    return laplace(problem, decisions, fit)


def moves(problem: TabularProblem, seed: int = 0, n_steps: int = 20) -> Decisions:
    """Ten episodes of a robot that mostly takes the first outcome."""
    rest = problem.mdp.transitions.n_outcomes - 1
    table = np.array([[0.9] + [0.1 / rest] * rest])
    return sampled(problem, np.ones((N_CELLS, 1)), table, 10, n_steps, seed)


@pytest.mark.parametrize(
    ("places", "pseudo_count"),
    [([1, 0, 0], 0.3), ([1, 0, 0, 0, 0], 1.0), ([1, 0, 1, 0], 0.3), ([1, 0, 0, 2], 1.0)],
    ids=str,
)
def test_what_is_identified_has_its_beta_posterior_and_what_is_not_keeps_its_prior(
    places, pseudo_count
):
    problem = one_way(places)
    decisions = moves(problem)
    found = fitted(problem, decisions, pseudo_count=pseudo_count)
    draws = laplace_draws(found, np.random.default_rng(1), 3000)
    table = draws.outcome_probabilities[:, 0]
    ahead = (decisions.next_state - decisions.state) % N_CELLS
    for place in set(places):
        mine = np.array(places) == place
        a = np.sum(ahead == place) + pseudo_count * mine.sum()
        exact = scipy.stats.beta(a, len(decisions) + pseudo_count * len(places) - a)
        total = table[:, mine].sum(axis=1)
        assert total.std() == pytest.approx(exact.std(), rel=0.06)
        assert np.quantile(total, [0.05, 0.95]) == pytest.approx(
            exact.ppf([0.05, 0.95]), abs=0.12 * exact.std()
        )
        assert scipy.stats.kstest(total, exact.cdf).pvalue > 1e-3
        if mine.sum() > 1:
            share = table[:, mine][:, 0] / total
            unseen = scipy.stats.beta(pseudo_count, pseudo_count * (mine.sum() - 1))
            # Counts are split by the last shares, so the states of a chain are correlated.
            assert share.mean() == pytest.approx(unseen.mean(), abs=0.2 * unseen.std())
            assert share.std() == pytest.approx(unseen.std(), rel=0.1)


@pytest.mark.parametrize("draw", ["modes", "beliefs", "information"])
def test_everything_that_draws_has_the_posterior_of_the_sum(draw):
    problem = one_way([1, 0, 0])
    decisions = moves(problem)
    n_ahead, n = int(np.sum(decisions.next_state != decisions.state)), len(decisions)
    found = fitted(problem, decisions, pseudo_count=1.0)
    rng = np.random.default_rng(0)
    if draw == "modes":
        fit = fit_mdce_serd(problem, decisions, prior=PriorByEvidence(pseudo_count=1.0))
        modes = posterior_modes(problem, decisions, fit, rng, n_starts=1)
        limits = credible_intervals(modes.draws(problem, rng, 1000))
    elif draw == "beliefs":
        compared = compare_beliefs(
            problem,
            decisions,
            (TiedBelief(), FreeBelief()),
            prior=PriorByEvidence(3.0, pseudo_count=1.0),
        )
        limits = credible_intervals(compared.draws(rng, 1000))
    if draw == "information":
        information = outcome_information(found)
        ends = [information.lower[0, 0], information.upper[0, 0]]
    else:
        ends = limits.outcome_probabilities[:, 0, 0]
    exact = scipy.stats.beta(n_ahead + 1, n - n_ahead + 2)
    np.testing.assert_allclose(ends, exact.ppf([0.05, 0.95]), atol=0.25 * exact.std())


C, SIGMA = 1.5, 1.0
REWARDS = GaussianPrior(SIGMA, Block.REWARD)


def two_states(aliased: bool) -> tuple[TabularProblem, Decisions]:
    """A model of outcomes, change or stay, applies to the first action; the second one waits.

    aliased: whether there are two outcomes of which both stay. Who likes it in state 1 takes the
    first action in state 0, and there the more often the likelier it is to change.
    """
    n_outcomes = 3 if aliased else 2
    successors = np.repeat(np.arange(2)[:, None, None], n_outcomes, axis=2)
    successors = np.repeat(successors, 2, axis=1)
    successors[[0, 1], 0, 0] = [1, 0]
    models = OutcomeModels(successors, [[0, 1], [0, 1]], np.ones((2, 2), bool), 2)
    features = np.array([[[0.0], [0.2]], [[1.0], [1.2]]])
    problem = TabularProblem(Mdp(models, 0.8), features, ("there",))
    state, action = np.repeat([0, 0, 1, 1], [9, 5, 4, 6]), np.repeat([0, 1, 0, 1], [9, 5, 4, 6])
    following = state.copy()
    following[:3], following[14:17] = 1, 0
    return problem, apart(state, action, following)


N_CHANGED, N_STAYED = 6, 7
WEIGHTS, LOGITS = np.linspace(-4.5, 4.5, 41), np.linspace(-8.0, 8.0, 41)


@cache
def log_choices(aliased: bool) -> np.ndarray:
    """(41, 41) log likelihood of the choices over weights and log odds of a change."""
    problem, decisions = two_states(aliased)
    p = scipy.special.expit(LOGITS)
    found = np.zeros((len(WEIGHTS), len(LOGITS)))
    stays = problem.mdp.transitions.n_outcomes - 1
    uniform = np.full(stays + 1, 1.0 / (stays + 1))
    for j, change in enumerate(p):
        table = np.array([[change] + [(1.0 - change) / stays] * stays, uniform])
        for i, weight in enumerate(WEIGHTS):
            policy = soft_policy(problem, [weight], table).probabilities
            found[i, j] = np.sum(np.log(policy[decisions.state, decisions.action]))
    return found


def log_beta_density(a: float, b: float) -> np.ndarray:
    """(41,) of the log odds, up to a constant."""
    return -a * np.log1p(np.exp(-LOGITS)) - b * np.log1p(np.exp(LOGITS))


def exact_marginals(belief: Belief, n_stays: int) -> dict[str, np.ndarray]:
    """Probabilities of the grid's weights, and of its log odds believed and true."""
    choices = log_choices(n_stays == 2) - 0.5 * (WEIGHTS[:, None] / SIGMA) ** 2
    counted = log_beta_density(N_CHANGED + C, N_STAYED + n_stays * C)
    if isinstance(belief, TiedBelief):
        joint = choices[:, :, None] + np.where(np.eye(len(LOGITS), dtype=bool), counted, -np.inf)
    elif isinstance(belief, FreeBelief) and not isinstance(belief, BeliefAroundTruth):
        believed = log_beta_density(C, n_stays * C)
        joint = choices[:, :, None] + believed[:, None] + counted
    else:
        # Two energies differ by half as much, with opposite signs, as their log odds.
        away = (LOGITS[:, None] - LOGITS) ** 2 / (4.0 * belief.deviation**2)
        joint = choices[:, :, None] - away + counted
    density = np.exp(joint - joint.max())
    density /= density.sum()
    return {
        "weight": density.sum(axis=(1, 2)),
        "believed": density.sum(axis=(0, 2)),
        "true": density.sum(axis=(0, 1)),
        "together": np.einsum("ijk,i,j->", density, WEIGHTS, LOGITS),
    }


def require_marginal(found: np.ndarray, grid: np.ndarray, density: np.ndarray) -> None:
    """The draws have mean, deviation and quantiles of a density on a grid."""
    mean = density @ grid
    deviation = np.sqrt(density @ (grid - mean) ** 2)
    assert found.mean() == pytest.approx(mean, abs=0.1 * deviation)
    assert found.std() == pytest.approx(deviation, rel=0.08)
    ends = grid + (grid[1] - grid[0]) / 2
    below = np.searchsorted(np.sort(found), ends) / len(found)
    np.testing.assert_allclose(below, np.cumsum(density), atol=0.05)


@pytest.mark.parametrize(
    ("belief", "aliased"),
    [
        (TiedBelief(), False),
        (TiedBelief(), True),
        (FreeBelief(), False),
        (FreeBelief(), True),
        (BeliefAroundTruth(0.7), False),
    ],
    ids=["tied", "tied aliased", "free", "free aliased", "around"],
)
def test_sweeps_keep_the_posterior_of_choices_and_moves(belief, aliased):
    """Against the sum over a grid of weights and log odds."""
    problem, decisions = two_states(aliased)
    prior = REWARDS + DirichletPrior(C)
    if belief == FreeBelief():
        prior = prior + DirichletPrior(C, Block.BELIEF)
    fit = fit_mdce_serd(problem, decisions, initial_weights=np.ones(1), belief=belief, prior=prior)
    found, rng = laplace(problem, decisions, fit), np.random.default_rng(0)
    assert needs_sweeps(found.posterior, found.coordinates) == aliased
    if aliased:
        points = found.sample(6400, rng)
    else:
        start = found.sample(64, rng)
        at = found.posterior, found.coordinates, found.mode, found.root
        points = swept(*at, start, 6400, rng)
    draws = draws_at(problem, found.coordinates, points)
    exact = exact_marginals(belief, n_stays=2 if aliased else 1)
    odds = {
        name: scipy.special.logit(table[:, 0, 0])
        for name, table in (
            ("believed", draws.believed_outcome_probabilities),
            ("true", draws.outcome_probabilities),
        )
    }
    weights = draws.reward[:, 0]
    require_marginal(weights, WEIGHTS, exact["weight"])
    for name, values in odds.items():
        require_marginal(values, LOGITS, exact[name])
    together = np.mean(weights * odds["believed"])
    scale = weights.std() * odds["believed"].std()
    assert together == pytest.approx(exact["together"], abs=0.1 * scale)


def test_draws_of_hidden_actions_are_those_of_the_sum_over_the_actions():
    """Two actions, each with its model, lead on or not; discount 0 makes choices logistic."""
    successors = np.array([[[1, 0], [1, 0]], [[1, 1], [1, 1]]])
    models = OutcomeModels(successors, [[0, 1], [0, 1]], np.ones((2, 2), bool), 2)
    features = np.array([[[1.0], [0.0]], [[0.0], [0.0]]])
    problem = TabularProblem(Mdp(models, 0.0), features, ("first",))
    shown, hidden = [(0, 1, 4), (0, 0, 1), (1, 1, 1), (1, 0, 2)], [(1, 9), (0, 4)]
    rows = [(a, s) for a, s, n in shown for _ in range(n)]
    rows += [(-1, s) for s, n in hidden for _ in range(n)]
    action, following = np.array(rows).T
    decisions = apart(0, action, following)
    fit = fit_mdce_serd(
        problem,
        decisions,
        initial_weights=np.zeros(1),
        dynamics=np.array([[0.7, 0.3], [0.4, 0.6]]),
        prior=REWARDS + DirichletPrior(C),
    )
    draws = laplace_draws(laplace(problem, decisions, fit), np.random.default_rng(0), 6400)
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


def ring(rng: np.random.Generator) -> tuple[TabularProblem, np.ndarray, Decisions]:
    """Cells in a ring, which two actions leave in two directions; three of four outcomes stay.

    Each action has a model in either half of the ring. Truth and weights are draws of the prior.
    """
    n, half = 12, 6
    cells = np.arange(n)
    successors = np.repeat(cells[:, None, None], 4, axis=2).repeat(2, axis=1)
    successors[:, 0, 0], successors[:, 1, 0] = (cells + 1) % n, (cells - 1) % n
    model_of = np.where((cells < half)[:, None], [0, 1], [2, 3])
    features = np.zeros((n, 2, 2))
    features[0, :, 0], features[:, 1, 1] = 1.0, 1.0
    models = OutcomeModels(successors, model_of, np.ones((n, 2), bool), 4)
    problem = TabularProblem(Mdp(models, 0.9), features, ("goal", "back"))
    truth = rng.dirichlet(np.full(4, 1.0), 4)
    policy = soft_policy(problem, rng.normal(0.0, 2.0, 2), truth).probabilities
    return problem, truth, sampled(problem, policy, truth, 40, 15, rng)


def test_intervals_of_aliased_outcomes_hold_the_truth_as_often_as_they_state():
    """Nine of ten truths that are draws of the prior; without sweeps it is seven of ten."""
    inside = []
    for seed in range(24):
        problem, truth, decisions = ring(np.random.default_rng(seed))
        found = fitted(problem, decisions, deviation=2.0, pseudo_count=1.0)
        draws = laplace_draws(found, np.random.default_rng(seed), 64)
        low, high = credible_intervals(draws).outcome_probabilities[:, :, 0]
        inside.append((low <= truth[:, 0]) & (truth[:, 0] <= high))
    assert 0.83 <= np.mean(inside) <= 0.97


def test_a_seed_gives_the_same_draws_and_another_seed_others():
    problem = one_way([1, 0, 0])
    found = fitted(problem, moves(problem))
    first, same, other = (found.sample(100, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, same)
    assert not np.any(first == other)
    for n in (1, 63, 65):
        assert found.sample(n, np.random.default_rng(0)).shape == (n, len(found.mode))


def test_units_of_features_do_not_matter():
    problem, decisions = two_states(aliased=True)
    other = TabularProblem(problem.mdp, problem.features * 1e8, problem.feature_names)
    ours, theirs = (
        laplace_draws(fitted(each, decisions, deviation=2.0, pseudo_count=1.0), rng, 60)
        for each, rng in ((problem, np.random.default_rng(0)), (other, np.random.default_rng(0)))
    )
    np.testing.assert_allclose(1e8 * theirs.reward, ours.reward, rtol=1e-3, atol=1e-3)


def test_draws_stay_as_they_are_where_each_outcome_has_a_state_of_its_own():
    """They are in pairs that mirror each other, and cost no solution of Bellman's equation."""
    problem = one_way([1, 0, 2])
    found = fitted(problem, moves(problem))
    assert not needs_sweeps(found.posterior, found.coordinates)
    weights = laplace_draws(found, np.random.default_rng(0), 100).reward
    mode = found.coordinates.parameters(found.mode).reward
    np.testing.assert_allclose(weights[:50] + weights[50:], 2 * mode[None].repeat(50, axis=0))


def test_rewards_alone_keep_their_normal_draws():
    problem = one_way([1, 0, 0])
    decisions = moves(problem)
    fit = fit_mdce_irl_by_likelihood(problem, decisions, prior=PriorByEvidence())
    found = laplace(problem, decisions, fit)
    assert not needs_sweeps(found.posterior, found.coordinates)


def test_chains_of_which_none_moves_are_no_result(monkeypatch):
    problem = one_way([1, 0, 0])
    found = fitted(problem, moves(problem))
    solve, calls = Surrogate.exact, []

    def always_less(self, points, values):
        calls.append(0)
        at = solve(self, points, values)
        return replace(at, log_others=at.log_others - 1e6 * len(calls))

    monkeypatch.setattr(Surrogate, "exact", always_less)
    with pytest.raises(SerdError, match="none of 240 sweeps was accepted; take a stronger prior"):
        laplace_draws(found, np.random.default_rng(0))
