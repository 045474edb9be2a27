from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
import scipy.special
import scipy.stats

import serd_core as sc
from serd_core.bayes.laplace import draws_at, laplace_at, log_posterior_of
from serd_core.bayes.strengths import strengths_of
from serd_core.demonstrations.observations import observe
from serd_core.policies.solved_policy import MdcePolicy
from serd_core.posterior.coordinates import LogPosterior, coordinates
from serd_core.posterior.posterior import Posterior
from support.small_problems import PROPER, apart, fit_of

BY_EVIDENCE, REWARDS = sc.PriorByEvidence(), sc.GaussianPrior(2.0, sc.Block.REWARD)
OF_BELIEF = sc.DirichletPrior(3.0, sc.Block.BELIEF)


@pytest.fixture(scope="module")
def by_evidence(gridworld):
    return sc.fit_mdce_serd(gridworld.problem, gridworld.decisions, prior=BY_EVIDENCE)


def approximated(problem, decisions, **options):
    """A fit and Laplace's approximation there."""
    if "prior" in options and options["prior"] is not BY_EVIDENCE:
        options.setdefault("initial_weights", np.zeros(len(problem.feature_names)))
    fit = sc.fit_mdce_serd(problem, decisions, **options)
    return fit, sc.laplace(problem, decisions, fit)


@pytest.mark.parametrize("same_successor", [False, True])
def test_the_evidence_of_dynamics_that_choices_inform_is_close_to_the_integral(same_successor):
    """Two states, one action of which leads by a model of two outcomes to the rewarded state."""
    successors = np.array([[[0, 1], [0, 0]], [[1, 0], [1, 1]]])
    if same_successor:
        successors[1, 0] = 0
    models = sc.OutcomeModels(successors, [[0, 1], [0, 1]], np.ones((2, 2), bool), 2)
    features = np.array([[[0.0], [0.3]], [[1.0], [1.0]]])
    problem = sc.TabularProblem(sc.Mdp(models, 0.8), features, ("there",))
    state, action = np.repeat([[0, 0, 1, 1], [0, 1, 0, 1]], [7, 3, 2, 4], axis=1)
    following = np.where(action == 1, state, 0)
    following[:5] = 1
    decisions = apart(state, action, following)
    fit, found = approximated(problem, decisions, initial_weights=np.ones(1), prior=PROPER)
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


def test_counted_transitions_have_their_exact_evidence(random_problem):
    """Where choices do not depend on the dynamics: a Dirichlet-multinomial distribution."""
    problem, _ = random_problem(3)
    problem = replace(problem, mdp=replace(problem.mdp, discount=0.0))
    model, rng = problem.mdp.transitions, np.random.default_rng(0)
    state, action = np.argwhere(model.available)[rng.integers(model.available.sum(), size=30)].T
    k = rng.integers(model.n_outcomes, size=30)
    decisions = apart(state, action, model.successors[state, action, k])
    _, evidence = approximated(problem, decisions, prior=REWARDS + sc.DirichletPrior(0.4))
    alone, of_rewards = approximated(problem, decisions, belief=sc.FixedBelief(), prior=REWARDS)
    by_policy = of_rewards.log_evidence - alone.dynamics_log_likelihood
    # By the chain rule over draws; outcomes of these pairs have different successors.
    exact, seen = 0.0, np.full((model.n_models, model.n_outcomes), 0.4)
    for s, a, following in zip(state, action, decisions.next_state, strict=True):
        explaining, row = model.successors[s, a] == following, seen[model.model_of[s, a]]
        assert explaining.sum() == 1
        exact += float(np.log(row[explaining].sum() / row.sum()))
        row[explaining] += 1.0
    assert evidence.log_evidence - by_policy == pytest.approx(exact, abs=1e-6)


def test_units_of_features_and_names_of_actions_do_not_matter(gridworld, by_evidence):
    problem, decisions, fit = gridworld.problem, gridworld.decisions, by_evidence
    found = sc.laplace(problem, decisions, fit)
    errors = np.sqrt(np.diag(found.covariance))[:2]
    factors, order = [1e-8, 1e8], np.array([3, 0, 4, 1, 2])
    scaled = replace(problem, features=problem.features * factors)
    same, again = approximated(scaled, decisions, prior=BY_EVIDENCE)
    assert fit.converged
    assert same.converged
    away = same.reward_weights * factors - fit.reward_weights
    assert np.all(np.abs(away) <= 1e-6 * errors)
    assert again.log_evidence == pytest.approx(found.log_evidence, abs=1e-6)
    model = problem.mdp.transitions
    columns = (table[:, order] for table in (model.successors, model.model_of, model.available))
    renamed = replace(decisions, action=np.argsort(order)[decisions.action])
    mdp = sc.Mdp(sc.OutcomeModels(*columns, 9), problem.mdp.discount)
    turned = replace(problem, mdp=mdp, features=problem.features[:, order])
    named = sc.fit_mdce_serd(turned, renamed, prior=BY_EVIDENCE)
    np.testing.assert_allclose(named.reward_weights, fit.reward_weights, rtol=1e-7)


def test_strengths_are_where_the_evidence_is_highest(gridworld, by_evidence):
    found = strengths_of(by_evidence.assumptions.prior, gridworld.problem)
    model = gridworld.problem.mdp.transitions
    strengths = BY_EVIDENCE.strengths(by_evidence.assumptions.belief, model)
    best = np.log([found["deviation"], found["pseudo_count"]])

    def worth(logs):
        prior = sc.PriorByEvidence(*np.exp(logs))
        evidence = approximated(gridworld.problem, gridworld.decisions, prior=prior)[1].log_evidence
        return evidence + strengths.log_density(logs)[0]

    highest = worth(best)
    for move in ([0.3, 0.0], [-0.3, 0.0], [0.0, 0.3], [0.0, -0.3]):
        assert worth(best + np.array(move)) < highest - 1e-3


def test_draws_of_counted_outcomes_are_those_of_the_posterior_itself():
    """One state is left for one of three by either action; an outcome that was never seen too."""
    successors = np.tile(np.arange(1, 4), (4, 2, 1))
    successors[1:] = np.arange(1, 4)[:, None, None]
    own, both = np.zeros((4, 2), int), np.ones((4, 2), bool)
    models, features = sc.OutcomeModels(successors, own, both, 1, beta=2.0), np.zeros((4, 2, 1))
    features[0, 0] = 1.0
    problem = sc.TabularProblem(sc.Mdp(models, 0.0), features, ("first",))
    seen, prior = np.array([30, 0, 4]), REWARDS + sc.DirichletPrior(0.2)
    decisions = apart(0, np.arange(34) % 2, np.repeat([1, 2, 3], seen))
    fit, found = approximated(problem, decisions, prior=prior)
    draws = sc.laplace_draws(found, np.random.default_rng(0), 4000)
    counts = seen + 0.2
    exact = [scipy.stats.beta(count, counts.sum() - count) for count in counts]
    for each, share in zip(exact, draws.outcome_probabilities[:, 0].T, strict=True):
        assert scipy.stats.kstest(share, each.cdf).pvalue > 0.01
    z = np.random.default_rng(0).standard_normal((2000, len(found.mode)))
    normal = draws_at(problem, found.coordinates, found.mode + z @ found.root.T)
    unseen = normal.outcome_probabilities[:, 0, 1]
    assert scipy.stats.kstest(unseen, exact[1].cdf).pvalue < 1e-9
    together = np.cov(draws.outcome_probabilities[:, 0].T)
    mean = counts / counts.sum()
    exact_cov = (np.diag(mean) - np.outer(mean, mean)) / (counts.sum() + 1)
    np.testing.assert_allclose(together, exact_cov, atol=0.06 * exact_cov.max())
    error = np.sqrt(found.covariance[0, 0])
    np.testing.assert_allclose(draws.reward.mean(axis=0), fit.reward_weights, atol=0.1 * error)
    assert draws.reward.std() == pytest.approx(error, rel=0.06)
    high = np.quantile(draws.reward, 0.95, axis=0)
    np.testing.assert_allclose(high, fit.reward_weights + 1.645 * error, atol=0.15 * error)


@pytest.mark.parametrize(
    ("prior", "belief", "message"),
    [
        (REWARDS + sc.KldPrior(1.0), sc.TiedBelief(), "normalised to 1, got KldPrior"),
        (REWARDS, sc.TiedBelief(), "density over the block belief or truth too"),
        (sc.DirichletPrior(1.0), sc.TiedBelief(), "density over the block reward too, got none"),
        (PROPER + REWARDS, sc.TiedBelief(), "reward must have one prior, got 2"),
        (PROPER + OF_BELIEF, sc.TiedBelief(), "belief or truth must have one prior, got 2"),
        (PROPER, sc.FixedBelief(), "which FixedBelief does not learn; leave it out"),
    ],
)
def test_priors_that_are_no_densities_of_what_is_learned_have_no_evidence(
    gridworld, by_evidence, prior, belief, message
):
    changed = replace(by_evidence.assumptions, prior=prior, belief=belief)
    assumed = replace(by_evidence, assumptions=changed)
    with pytest.raises(sc.SerdError, match=message):
        sc.laplace(gridworld.problem, gridworld.decisions, assumed)


def test_a_direction_that_bends_up_is_named_and_points_on_the_way_are_rejected(
    minimum_example, gridworld
):
    """Between the two explanations of section 4.6.1 the posterior has a saddle."""
    decisions = apart(0, 0, [0, 1, 1] * 10)
    observations = observe(minimum_example, decisions)
    posterior = Posterior(minimum_example, observations, MdcePolicy(), PROPER)
    start = sc.fit_mdce_serd(minimum_example, decisions, prior=BY_EVIDENCE).parameters
    space = coordinates(minimum_example, sc.TiedBelief(), start)
    with pytest.raises(sc.SerdError, match=r"information is -.* along .*reward state"):
        laplace_at(LogPosterior(posterior, space), np.zeros(3))
    stopped = fit_of(gridworld, [1.0, 1.0], prior=PROPER, on_step=lambda step: step.number == 4)
    with pytest.raises(sc.SerdError, match=r"Newton step is at most|bend down"):
        sc.laplace(gridworld.problem, gridworld.decisions, stopped)


def test_what_has_no_evidence_is_rejected_before_the_fit(gridworld):
    case = gridworld.problem, gridworld.decisions
    with pytest.raises(sc.SerdError, match="prior that is no density"):
        sc.fit_mdce_serd(*case, prior=BY_EVIDENCE, belief=sc.CoupledBelief(1.0))
    with pytest.raises(sc.SerdError, match="policy model with a temperature"):
        sc.fit_pm_serd(*case, prior=BY_EVIDENCE)
    with pytest.raises(sc.SerdError, match="intended_ratio of DirichletPrior needs OutcomeModels"):
        sc.fit_mdce_serd(*case, prior=sc.PriorByEvidence(intended_ratio=5.0))


def test_a_callback_follows_and_stops_the_search(gridworld):
    steps = []
    stop = {"on_step": lambda step: steps.append(step) or step.number == 5}
    fit = sc.fit_mdce_serd(gridworld.problem, gridworld.decisions, prior=BY_EVIDENCE, **stop)
    assert [step.number for step in steps] == [1, 2, 3, 4, 5]
    assert all(len(step.vector) in (2, 47) for step in steps)
    assert not fit.converged
    assert "stopped" in fit.message


def test_models_that_no_decision_shows_do_what_they_intend_as_often_as_the_others():
    """Of four models of a state, three are seen to lead on in 27 of 30 decisions."""
    successors = np.tile(np.arange(1, 4), (4, 4, 1))
    successors[1:] = np.arange(1, 4)[:, None, None]
    model_of, both = np.tile(np.arange(4), (4, 1)), np.ones((4, 4), bool)
    decisions = apart(0, np.repeat(np.arange(3), 30), np.tile([1] * 27 + [2, 2, 3], 3))
    by_intention, found = sc.PriorByEvidence(intended_ratio=None), []
    for intended in (None, [0, 0, 0, 0]):
        models = sc.OutcomeModels(successors, model_of, both, 4, intended=intended)
        problem = sc.TabularProblem(sc.Mdp(models, 0.0), np.zeros((4, 4, 1)), ("nothing",))
        found.append(sc.fit_mdce_serd(problem, decisions, prior=by_intention))
    alike, shared = (fit.outcome_probabilities for fit in found)
    np.testing.assert_allclose(alike[3], 1 / 3, atol=1e-6)
    np.testing.assert_allclose(shared[:3, 0], 0.9, atol=0.02)
    assert 0.8 < shared[3, 0] < 0.95
