from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
import scipy.special
import scipy.stats

from serd_core.bayes.draws import (
    credible_intervals,
    draws_at,
    laplace_draws,
    posterior_policy,
)
from serd_core.bayes.laplace import laplace, laplace_at, log_posterior_of
from serd_core.bayes.strengths import PriorByEvidence, strengths_of
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import observe
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.sparse_model import learned_transitions
from serd_core.errors import SerdError
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood
from serd_core.learners.serd import fit_mdce_serd, fit_pm_serd
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.policy_model import MdcePolicy
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior.beliefs import (
    BeliefAroundTruth,
    CoupledBelief,
    FixedBelief,
    FreeBelief,
    TiedBelief,
)
from serd_core.posterior.coordinates import LogPosterior, coordinates
from serd_core.posterior.parameters import Block
from serd_core.posterior.posterior import Posterior
from serd_core.priors.dirichlet import DirichletPrior
from serd_core.priors.divergence import KldPrior
from serd_core.priors.gaussian import GaussianPrior
from support.small_problems import PROPER, apart, fit_of, one_choice, sampled

BY_EVIDENCE = PriorByEvidence()
#: Stay, and one cell up, right, down or left: rows and columns.
OUTCOMES = ((0, 0), (1, 0), (0, 1), (-1, 0), (0, -1))


@pytest.fixture(scope="module")
def by_evidence(gridworld):
    """The fit of the gridworld with its strengths by evidence."""
    return fit_mdce_serd(gridworld.problem, gridworld.decisions, prior=BY_EVIDENCE)


def scaled(problem: TabularProblem, factors: list[float]) -> TabularProblem:
    return TabularProblem(problem.mdp, problem.features * np.array(factors), problem.feature_names)


def test_the_evidence_agrees_with_numerical_integration():
    problem, decisions = one_choice(9, 4)
    fit = fit_mdce_serd(problem, decisions, initial_weights=np.zeros(1), prior=PROPER)
    found = laplace(problem, decisions, fit)

    def choices(w: float) -> float:
        normal = np.exp(-0.5 * (w / 2.0) ** 2) / (2.0 * np.sqrt(2.0 * np.pi))
        return normal * scipy.special.expit(w) ** 9 * scipy.special.expit(-w) ** 4

    by_reward = np.log(scipy.integrate.quad(choices, -40, 40)[0])
    outcomes = scipy.special.betaln(8 + 0.7, 5 + 0.7) - scipy.special.betaln(0.7, 0.7)
    assert found.log_evidence == pytest.approx(by_reward + outcomes, abs=0.03)


@pytest.mark.parametrize("same_successor", [False, True])
def test_the_evidence_of_dynamics_that_choices_inform_is_close_to_the_integral(same_successor):
    """Two states, one action of which leads by a model of two outcomes to the rewarded state."""
    successors = np.array([[[0, 1], [0, 0]], [[1, 0], [1, 1]]])
    if same_successor:
        successors[1, 0] = 0
    models = OutcomeModels(successors, [[0, 1], [0, 1]], np.ones((2, 2), bool), 2)
    features = np.array([[[0.0], [0.3]], [[1.0], [1.0]]])
    problem = TabularProblem(Mdp(models, 0.8), features, ("there",))
    state, action = np.repeat([0, 0, 1, 1], [7, 3, 2, 4]), np.repeat([0, 1, 0, 1], [7, 3, 2, 4])
    following = np.where(action == 1, state, 0)
    following[:5] = 1
    decisions = apart(state, action, following)
    fit = fit_mdce_serd(problem, decisions, initial_weights=np.ones(1), prior=PROPER)
    found = laplace(problem, decisions, fit)
    objective = log_posterior_of(problem, decisions, fit)
    constant = found.coordinates.log_volume + objective.posterior.prior.log_constant(
        models, fit.parameters
    )
    steps = np.linspace(-6.0, 6.0, 9)
    # One cell of the grid has the volume det(root) spacing^3.
    grid = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    values = [objective.evaluate(found.mode + found.root @ z)[0] for z in grid]
    volume = np.linalg.slogdet(found.root)[1] + 3.0 * np.log(steps[1] - steps[0])
    exact = scipy.special.logsumexp(values) + volume + constant
    assert found.log_evidence == pytest.approx(exact, abs=0.15)


def test_no_direction_is_wider_than_under_the_prior(gridworld):
    """Where a maximum is about to vanish, its information would be 0 and its evidence infinite."""
    few = gridworld.decisions.select(np.arange(6))
    fit = fit_mdce_serd(gridworld.problem, few, belief=FreeBelief())
    assert fit.converged
    found, objective = (of(gridworld.problem, few, fit) for of in (laplace, log_posterior_of))
    widths = found.root.T @ objective.prior_information(found.mode) @ found.root
    assert np.linalg.eigvalsh(widths)[-1] <= 1.0 + 1e-9


def test_a_belief_around_the_truth_does_not_bias_it():
    """Choices that depend on no dynamics leave the truth where counts have it, and the belief."""
    problem, decisions = one_choice(9, 4)
    start = {"initial_weights": np.zeros(1), "prior": PROPER}
    fit = fit_mdce_serd(problem, decisions, belief=BeliefAroundTruth(0.8), **start)
    counted = np.array([[8 + 0.7, 5 + 0.7]]) / (13 + 1.4)
    np.testing.assert_allclose(fit.outcome_probabilities, counted, atol=1e-6)
    np.testing.assert_allclose(fit.believed_outcome_probabilities, counted, atol=1e-6)
    alone = fit_mdce_serd(problem, decisions, **start)
    evidences = [laplace(problem, decisions, each).log_evidence for each in (fit, alone)]
    assert evidences[0] == pytest.approx(evidences[1], abs=1e-6)


def test_a_large_constant_in_a_feature_does_not_matter(gridworld):
    given = gridworld.problem
    other = TabularProblem(given.mdp, given.features + np.array([1e6, 0.0]), given.feature_names)
    fit, same = (
        fit_mdce_serd(problem, gridworld.decisions, prior=PriorByEvidence(3.0, 1.0))
        for problem in (given, other)
    )
    assert same.converged
    np.testing.assert_allclose(same.reward_weights, fit.reward_weights, rtol=1e-5)


def test_dynamics_without_outcome_models_are_rejected_before_the_fit():
    model = learned_transitions((2, 1), [0, 0, 1], [0, 0, 0], [0, 1, 1])
    problem = TabularProblem(Mdp(model, 0.5), np.ones((2, 1, 1)), ("one",))
    with pytest.raises(SerdError, match="PriorByEvidence is a prior of OutcomeModels, got Sparse"):
        fit_mdce_serd(problem, apart(0, 0, [0, 1]), dynamics=np.zeros(1))


def test_counted_transitions_have_their_exact_evidence(random_problem):
    """Where choices do not depend on the dynamics: a Dirichlet-multinomial distribution."""
    problem, _ = random_problem(3)
    still = replace(problem.mdp, discount=0.0)
    problem = TabularProblem(still, problem.features, problem.feature_names)
    model = still.transitions
    rng = np.random.default_rng(0)
    state, action = np.argwhere(model.available)[rng.integers(model.available.sum(), size=30)].T
    k = rng.integers(model.n_outcomes, size=30)
    decisions = apart(state, action, model.successors[state, action, k])
    reward, start = GaussianPrior(2.0, Block.REWARD), {"initial_weights": np.zeros(2)}
    tied = fit_mdce_serd(problem, decisions, prior=reward + DirichletPrior(0.4), **start)
    alone = fit_mdce_serd(problem, decisions, belief=FixedBelief(), prior=reward, **start)
    evidence, of_rewards = (laplace(problem, decisions, fit).log_evidence for fit in (tied, alone))
    by_policy = of_rewards - alone.dynamics_log_likelihood
    exact = dirichlet_multinomial(problem, decisions, 0.4)
    assert evidence - by_policy == pytest.approx(exact, abs=1e-6)


def dirichlet_multinomial(problem: TabularProblem, decisions: Decisions, count: float) -> float:
    """By the chain rule over draws; needs pairs whose outcomes have different successors."""
    model = problem.mdp.transitions
    total, seen = 0.0, np.full((model.n_models, model.n_outcomes), count)
    for s, a, following in zip(
        decisions.state, decisions.action, decisions.next_state, strict=True
    ):
        explaining = model.successors[s, a] == following
        if explaining.sum() != 1:
            pytest.skip("the random problem has outcomes with equal successors")
        row = seen[model.model_of[s, a]]
        total += float(np.log(row[explaining].sum() / row.sum()))
        row[explaining] += 1.0
    return total


def test_units_of_features_do_not_matter(gridworld, by_evidence):
    fit, factors = by_evidence, [1e-8, 1e8]
    other = scaled(gridworld.problem, factors)
    same = fit_mdce_serd(other, gridworld.decisions, prior=BY_EVIDENCE)
    found = laplace(gridworld.problem, gridworld.decisions, fit)
    errors = np.sqrt(np.diag(found.covariance))[:2]
    assert fit.converged
    assert same.converged
    away = same.reward_weights * factors - fit.reward_weights
    assert np.all(np.abs(away) <= 1e-6 * errors)
    again = laplace(other, gridworld.decisions, same)
    assert again.log_evidence == pytest.approx(found.log_evidence, abs=1e-6)


def test_the_gauge_of_the_energies_does_not_matter(gridworld, by_evidence):
    fit = by_evidence
    shifted = fit.parameters.truth + np.repeat(np.arange(9.0), 5)
    moved = replace(fit, parameters=replace(fit.parameters, truth=shifted, belief=shifted))
    first = laplace(gridworld.problem, gridworld.decisions, fit)
    second = laplace(gridworld.problem, gridworld.decisions, moved)
    assert second.log_evidence == pytest.approx(first.log_evidence, abs=1e-8)


def test_names_of_actions_do_not_matter(gridworld, by_evidence):
    order = np.array([3, 0, 4, 1, 2])
    given, model = gridworld.problem, gridworld.problem.mdp.transitions
    models = OutcomeModels(
        model.successors[:, order], model.model_of[:, order], model.available[:, order], 9
    )
    problem = TabularProblem(
        Mdp(models, given.mdp.discount), given.features[:, order], given.feature_names
    )
    seen = gridworld.decisions
    renamed = replace(seen, action=np.argsort(order)[seen.action])
    second = fit_mdce_serd(problem, renamed, prior=BY_EVIDENCE)
    np.testing.assert_allclose(second.reward_weights, by_evidence.reward_weights, rtol=1e-7)


def test_an_outcome_model_that_no_one_uses_adds_no_evidence(gridworld):
    given, model = gridworld.problem, gridworld.problem.mdp.transitions
    more = OutcomeModels(model.successors, model.model_of, model.available, 10)
    problem = TabularProblem(Mdp(more, given.mdp.discount), given.features, given.feature_names)
    prior = GaussianPrior(2.0, Block.REWARD) + DirichletPrior(0.3)
    values = [
        laplace(
            one,
            gridworld.decisions,
            fit_mdce_serd(one, gridworld.decisions, initial_weights=np.zeros(2), prior=prior),
        ).log_evidence
        for one in (given, problem)
    ]
    assert values[1] == pytest.approx(values[0], abs=1e-8)


def test_strengths_are_where_the_evidence_is_highest(gridworld, by_evidence):
    fit = by_evidence
    found = strengths_of(fit.assumptions.prior, gridworld.problem)
    strengths = BY_EVIDENCE.strengths(fit.assumptions.belief)
    best = np.log([found["deviation"], found["pseudo_count"]])

    def worth(logs: np.ndarray) -> float:
        given = PriorByEvidence(*np.exp(logs))
        one = fit_mdce_serd(gridworld.problem, gridworld.decisions, prior=given)
        evidence = laplace(gridworld.problem, gridworld.decisions, one).log_evidence
        return evidence + strengths.log_density(logs)[0]

    highest = worth(best)
    for move in ([0.3, 0.0], [-0.3, 0.0], [0.0, 0.3], [0.0, -0.3]):
        assert worth(best + np.array(move)) < highest - 1e-3


def test_fits_start_without_chance(gridworld, by_evidence):
    rng = np.random.default_rng(1)
    fit = fit_mdce_serd(gridworld.problem, gridworld.decisions, rng=rng, prior=BY_EVIDENCE)
    np.testing.assert_array_equal(fit.reward_weights, by_evidence.reward_weights)


def without_walls(gridworld) -> tuple[TabularProblem, Decisions]:
    """The gridworld bent to a torus, where each outcome leads to a cell of its own."""
    given, models = gridworld.problem, gridworld.problem.mdp.transitions
    row, column = np.divmod(np.arange(25), 5)
    moved = [(row + i) % 5 * 5 + (column + j) % 5 for i, j in OUTCOMES]
    successors = np.repeat(np.stack(moved, axis=1)[:, None], 5, axis=1)
    mdp = Mdp(replace(models, successors=successors), given.mdp.discount)
    problem = TabularProblem(mdp, given.features, given.feature_names)
    policy = soft_policy(problem, gridworld.weights, gridworld.probabilities).probabilities
    return problem, sampled(problem, policy, gridworld.probabilities, 20, 15)


def test_draws_have_the_moments_of_the_approximation(gridworld):
    problem, decisions = without_walls(gridworld)
    fit = fit_mdce_serd(problem, decisions, prior=BY_EVIDENCE)
    found = laplace(problem, decisions, fit)
    draws = laplace_draws(found, np.random.default_rng(0), 4000)
    np.testing.assert_allclose(draws.reward.mean(axis=0), fit.reward_weights, rtol=1e-9)
    errors = np.sqrt(np.diag(found.covariance))[:2]
    np.testing.assert_allclose(draws.reward.std(axis=0), errors, rtol=0.06)
    intervals = credible_intervals(draws)
    normal = fit.reward_weights + 1.645 * errors
    np.testing.assert_allclose(intervals.reward[1], normal, atol=0.15 * errors.max())
    table = intervals.outcome_probabilities
    assert np.all(table[0] <= fit.outcome_probabilities)
    assert np.all(table[1] >= fit.outcome_probabilities)


def test_draws_of_counted_outcomes_are_those_of_the_posterior_itself():
    """One state is left for one of three by either action; an outcome that was never seen too."""
    successors = np.tile(np.arange(1, 4), (4, 2, 1))
    successors[1:] = np.arange(1, 4)[:, None, None]
    models = OutcomeModels(successors, np.zeros((4, 2), int), np.ones((4, 2), bool), 1, beta=2.0)
    features = np.zeros((4, 2, 1))
    features[0, 0] = 1.0
    problem = TabularProblem(Mdp(models, 0.0), features, ("first",))
    seen, prior = np.array([30, 0, 4]), GaussianPrior(2.0, Block.REWARD) + DirichletPrior(0.2)
    n = int(seen.sum())
    following = np.repeat([1, 2, 3], seen)
    actions = np.arange(n) % 2
    decisions = apart(0, actions, following)
    fit = fit_mdce_serd(problem, decisions, initial_weights=np.zeros(1), prior=prior)
    found = laplace(problem, decisions, fit)
    draws = laplace_draws(found, np.random.default_rng(0), 4000)
    counts = seen + 0.2
    first = slice(2000)  # the others mirror them
    exact = [scipy.stats.beta(count, counts.sum() - count) for count in counts]
    for each, share in zip(exact, draws.outcome_probabilities[first, 0].T, strict=True):
        assert scipy.stats.kstest(share, each.cdf).pvalue > 0.01
    z = np.random.default_rng(0).standard_normal((2000, len(found.mode)))
    normal = draws_at(problem, found.coordinates, found.mode + z @ found.root.T)
    unseen = normal.outcome_probabilities[:, 0, 1]
    assert scipy.stats.kstest(unseen, exact[1].cdf).pvalue < 1e-9
    together = np.cov(draws.outcome_probabilities[:, 0].T)
    mean = counts / counts.sum()
    exact_cov = (np.diag(mean) - np.outer(mean, mean)) / (counts.sum() + 1)
    np.testing.assert_allclose(together, exact_cov, atol=0.06 * exact_cov.max())
    np.testing.assert_allclose(draws.reward.mean(axis=0), fit.reward_weights, atol=1e-9)


def test_the_averaged_policy_is_the_mean_of_the_policies(gridworld, by_evidence):
    found = laplace(gridworld.problem, gridworld.decisions, by_evidence)
    draws = laplace_draws(found, np.random.default_rng(0), 6)
    each = [
        soft_policy(gridworld.problem, w, p).probabilities
        for w, p in zip(draws.reward, draws.believed_outcome_probabilities, strict=True)
    ]
    policy = posterior_policy(gridworld.problem, draws)
    np.testing.assert_allclose(policy, np.mean(each, axis=0), atol=1e-9)


@pytest.mark.parametrize("belief", [FreeBelief(), BeliefAroundTruth(5.0), FixedBelief()])
def test_coordinates_have_the_right_derivatives(gridworld, by_evidence, belief):
    prior, start = BY_EVIDENCE.strengths(belief), by_evidence.parameters
    posterior = Posterior(
        gridworld.problem,
        observe(gridworld.problem.mdp, gridworld.decisions),
        MdcePolicy(),
        prior.prior(gridworld.problem, prior.start),
    )
    space = coordinates(gridworld.problem, belief, start)
    objective = LogPosterior(posterior, space)
    rng = np.random.default_rng(1)
    at = space.of(start) + 0.1 * rng.normal(size=space.table.shape[1])
    along = rng.normal(size=len(at))
    above, below = (objective.evaluate(at + step * 1e-5 * along) for step in (1.0, -1.0))
    slope = (above[0] - below[0]) / 2e-5
    assert objective.evaluate(at)[1] @ along == pytest.approx(slope, rel=1e-5)
    bend = (above[1] - below[1]) / 2e-5
    np.testing.assert_allclose(objective.hessian(at) @ along, bend, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize(
    ("prior", "message"),
    [
        (GaussianPrior(2.0, Block.REWARD) + KldPrior(1.0), "normalised to 1, got KldPrior"),
        (GaussianPrior(2.0, Block.REWARD), "density over the block belief or truth too"),
        (DirichletPrior(1.0), "density over the block reward too, got none"),
        (PROPER + GaussianPrior(2.0, Block.REWARD, mean=9.0), "reward must have one prior, got 2"),
        (PROPER + DirichletPrior(3.0, Block.BELIEF), "belief or truth must have one prior, got 2"),
    ],
)
def test_priors_that_are_no_densities_have_no_evidence(gridworld, by_evidence, prior, message):
    assumed = replace(by_evidence, assumptions=replace(by_evidence.assumptions, prior=prior))
    with pytest.raises(SerdError, match=message):
        laplace(gridworld.problem, gridworld.decisions, assumed)


def test_a_prior_of_what_is_not_learned_is_rejected(gridworld):
    fit = fit_mdce_irl_by_likelihood(gridworld.problem, gridworld.decisions, prior=BY_EVIDENCE)
    assert fit.converged
    assert fit.gradient_norm <= 1e-7
    assumed = replace(fit, assumptions=replace(fit.assumptions, prior=PROPER))
    with pytest.raises(SerdError, match="which FixedBelief does not learn; leave it out"):
        laplace(gridworld.problem, gridworld.decisions, assumed)


def test_a_direction_that_bends_up_is_named(minimum_example):
    """Between the two explanations of section 4.6.1 the posterior has a saddle."""
    decisions = apart(0, 0, [0, 1, 1] * 10)
    observations = observe(minimum_example.mdp, decisions)
    posterior = Posterior(minimum_example, observations, MdcePolicy(), PROPER)
    start = fit_mdce_serd(minimum_example, decisions, prior=BY_EVIDENCE).parameters
    space = coordinates(minimum_example, TiedBelief(), start)
    with pytest.raises(SerdError, match=r"information is -.* along .*reward state"):
        laplace_at(LogPosterior(posterior, space), np.zeros(3))


def test_a_point_on_the_way_has_no_approximation(gridworld):
    stopped = fit_of(gridworld, [1.0, 1.0], prior=PROPER, on_step=lambda step: step.number == 4)
    with pytest.raises(SerdError, match=r"Newton step is at most|bend down"):
        laplace(gridworld.problem, gridworld.decisions, stopped)


def test_what_has_no_evidence_is_rejected_before_the_fit(gridworld):
    case = gridworld.problem, gridworld.decisions
    with pytest.raises(SerdError, match="CoupledBelief has a prior that is no density"):
        fit_mdce_serd(*case, belief=CoupledBelief(1.0), prior=BY_EVIDENCE)
    with pytest.raises(SerdError, match="policy model with a temperature"):
        fit_pm_serd(*case, prior=BY_EVIDENCE)
    with pytest.raises(SerdError, match="deviation of BeliefAroundTruth must be a number"):
        fit_mdce_serd(*case, initial_weights=np.zeros(2), belief=BeliefAroundTruth(), prior=PROPER)
    for wrong in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(SerdError, match="deviation of PriorByEvidence must be finite and"):
            PriorByEvidence(deviation=wrong)


def test_a_callback_follows_and_stops_the_search(gridworld):
    numbers = []

    def stop_at_five(step):
        numbers.append(step.number)
        assert len(step.vector) in (2, 47)
        return step.number == 5

    fit = fit_mdce_serd(
        gridworld.problem, gridworld.decisions, prior=BY_EVIDENCE, on_step=stop_at_five
    )
    assert numbers == [1, 2, 3, 4, 5]
    assert not fit.converged
    assert "stopped" in fit.message
