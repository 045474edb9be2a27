"""Outcome models with covariates against finite differences, Table 5.1 and a known truth."""

from dataclasses import replace

import numpy as np
import pytest

from lab.experiments.study.people.covariate_models import (
    CovariateModels,
    estimated_dynamics,
    most_likely_coefficients,
)
from serd_core.bayes.information import outcome_information
from serd_core.bayes.laplace import laplace
from serd_core.bayes.sweeps import needs_sweeps
from serd_core.bellman.linear.lu import SparseLu
from serd_core.bellman.newton import Newton
from serd_core.demonstrations.observations import observe
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.errors import SerdError
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.policy_model import MdcePolicy, PolicyMatchingPolicy
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior.beliefs import BeliefAroundTruth, FixedBelief, FreeBelief, TiedBelief
from serd_core.posterior.parameters import Block
from serd_core.posterior.posterior import Posterior
from serd_core.priors.dirichlet import DirichletPrior
from serd_core.priors.gaussian import GaussianPrior
from support.random_posteriors import (
    assert_gradient_is_of_the_objective,
    assert_hessian_is_of_the_gradient,
    random_parameters,
    uniform_decisions,
)

BELIEFS = [TiedBelief(), FreeBelief(), BeliefAroundTruth(0.8), FixedBelief()]
POLICIES = [MdcePolicy(), PolicyMatchingPolicy(start_temperature=1.7)]


def with_covariates(problem, covariates, model_of=None):
    """The same problem with rows of covariates in place of its models."""
    models = problem.mdp.transitions
    changed = CovariateModels(
        successors=models.successors,
        model_of=models.model_of if model_of is None else model_of,
        available=models.available,
        n_models=len(covariates),
        intended=None if models.intended is None else np.zeros(len(covariates), int),
        covariates=covariates,
    )
    mdp = Mdp(changed, problem.mdp.discount)
    return TabularProblem(mdp, problem.features, problem.feature_names)


def crowded(problem, seed, n_rows=12, n_features=3):
    """Each pair (s, a) has one of some rows of random covariates, of which the first is 1."""
    rng = np.random.default_rng(seed)
    covariates = rng.normal(size=(n_rows, n_features))
    covariates[:, 0] = 1.0
    shape = problem.mdp.available.shape
    return with_covariates(problem, covariates, rng.integers(n_rows, size=shape))


@pytest.mark.parametrize("share_hidden", [1.0, 0.5, 0.0])
@pytest.mark.parametrize("belief", BELIEFS, ids=lambda belief: type(belief).__name__)
@pytest.mark.parametrize("policy_model", POLICIES, ids=lambda model: type(model).__name__)
def test_gradient_and_hessian_are_the_finite_differences(
    random_problem, policy_model, belief, share_hidden
):
    problem = crowded(random_problem(15)[0], 15)
    rng = np.random.default_rng(6)
    like = random_parameters(problem, policy_model, rng)
    table = problem.mdp.transitions.local_probabilities(like.truth)
    decisions = uniform_decisions(problem, table, rng)
    decisions = decisions.with_hidden_actions(rng.random(len(decisions)) < share_hidden)
    prior = GaussianPrior(2.0, Block.REWARD) + DirichletPrior(0.7) + belief.prior
    observations = observe(problem.mdp, decisions)
    posterior = Posterior(problem, observations, policy_model, prior, Newton(), SparseLu())
    parameters = belief.unpack(belief.pack(like), like)
    assert_gradient_is_of_the_objective(posterior, belief, parameters)
    assert_hessian_is_of_the_gradient(posterior, belief, parameters)


@pytest.mark.parametrize(("n_rows", "n_features"), [(9, 2), (3, 3)])
def test_rows_that_no_pair_has_change_nothing(random_problem, n_rows, n_features):
    plain = random_problem(15)[0]
    problem = crowded(plain, 15, n_rows, n_features)
    models = problem.mdp.transitions
    first = replace(models, model_of=np.zeros_like(models.model_of))
    gathered = first.gather(np.ones(first.n_entries))
    assert gathered.shape == (n_rows, first.n_outcomes)
    assert gathered[0].sum() == first.n_entries
    assert not gathered[1:].any()


def test_indicators_of_models_are_the_table_of_outcome_models(make_gridworld):
    case = make_gridworld()
    same = with_covariates(case.problem, np.eye(9))
    prior = GaussianPrior(2.0, Block.REWARD) + DirichletPrior(1.0)
    hidden = case.decisions
    fits = [
        fit_mdce_serd(problem, hidden, prior=prior, initial_weights=np.zeros(2))
        for problem in (case.problem, same)
    ]
    assert all(fit.converged for fit in fits)
    assert fits[0].objective == pytest.approx(fits[1].objective, abs=1e-6)
    np.testing.assert_allclose(fits[0].reward_weights, fits[1].reward_weights, atol=1e-4)
    np.testing.assert_allclose(
        fits[0].outcome_probabilities, fits[1].outcome_probabilities, atol=1e-4
    )
    parameters = fits[0].parameters
    jacobians = [
        problem.mdp.transitions.local_jacobian(parameters.truth) for problem in (case.problem, same)
    ]
    np.testing.assert_allclose(*jacobians, atol=1e-12)
    estimates = [estimated_dynamics(problem, case.decisions) for problem in (case.problem, same)]
    np.testing.assert_allclose(*estimates, atol=1e-4)


def test_a_density_that_holds_people_up_is_recovered_from_states_alone(make_gridworld):
    """P(ahead | density) falls from 0.95 to 0.2 between the density 0 and 3."""
    problem = make_gridworld(side=7, discount=0.9).problem
    rng = np.random.default_rng(0)
    density = np.linspace(0, 3, 7)
    row = rng.integers(7, size=problem.mdp.n_states)[:, None].repeat(5, axis=1)
    states = np.arange(problem.mdp.n_states)
    grid = problem.mdp.transitions.successors[:, 0, :]
    successors = np.stack([grid, np.repeat(states[:, None], 5, axis=1)], axis=2)
    covariates = np.stack([np.ones(7), density], axis=1)
    models = CovariateModels(
        successors=successors,
        model_of=row,
        available=problem.mdp.available,
        n_models=7,
        intended=np.zeros(7, int),
        covariates=covariates,
        covariate_names=("always", "density"),
    )
    truth = np.array([[1.5, -1.5], [-0.72, 0.72]])
    table = models.local_probabilities(truth.ravel())
    assert table[0, 0] > 0.95
    assert table[-1, 0] < 0.25
    crowd = TabularProblem(Mdp(models, 0.9), problem.features, problem.feature_names)
    weights = np.array([2.0, 4.0])
    decisions = sample_decisions(
        crowd.mdp,
        soft_policy(crowd, weights, table).probabilities,
        table,
        np.full(crowd.mdp.n_states, 1 / crowd.mdp.n_states),
        n_episodes=200,
        n_steps=15,
        rng=rng,
    )
    fit = fit_mdce_serd(crowd, decisions.with_hidden_actions())
    assert fit.converged
    np.testing.assert_allclose(fit.outcome_probabilities, table, atol=0.12)
    posterior = laplace(crowd, decisions.with_hidden_actions(), fit)
    assert np.isfinite(posterior.log_evidence)
    shown = estimated_dynamics(crowd, decisions)
    np.testing.assert_allclose(shown, table, atol=0.04)
    with pytest.raises(SerdError, match="must converge, but after 1 steps its slope is"):
        most_likely_coefficients(models, observe(crowd.mdp, decisions), max_steps=1)


def test_probabilities_in_reach_of_the_covariates_have_exact_parameters(random_problem):
    models = crowded(random_problem(15)[0], 15).mdp.transitions
    parameters = np.random.default_rng(1).normal(size=models.n_parameters)
    table = models.local_probabilities(parameters)
    for found in (models.parameters_of(table), models.fixed_parameters_of(table)):
        np.testing.assert_allclose(models.local_probabilities(found), table, atol=1e-12)


def test_known_probabilities_out_of_reach_are_rejected(random_problem):
    models = crowded(random_problem(15)[0], 15).mdp.transitions
    table = np.random.default_rng(1).dirichlet(np.ones(models.n_outcomes), models.n_models)
    with pytest.raises(SerdError, match="must be linear in the covariates"):
        models.fixed_parameters_of(table)


def test_covariates_that_repeat_each_other_are_rejected(random_problem):
    models = crowded(random_problem(15)[0], 15).mdp.transitions
    doubled = np.concatenate([models.covariates, models.covariates[:, :1]], axis=1)
    with pytest.raises(SerdError, match="must have linearly independent columns, got rank 3 of 4"):
        replace(models, covariates=doubled, covariate_names=())


def test_exact_draws_and_counts_of_information_are_of_models_without_covariates(make_gridworld):
    case = make_gridworld(n_episodes=5)
    problem = with_covariates(case.problem, np.eye(9))
    prior = GaussianPrior(2.0, Block.REWARD) + DirichletPrior(1.0)
    fit = fit_mdce_serd(problem, case.decisions, prior=prior, initial_weights=np.zeros(2))
    found = laplace(problem, case.decisions, fit)
    assert not needs_sweeps(found.posterior, found.coordinates)
    with pytest.raises(SerdError, match="information is counted per outcome model, got models"):
        outcome_information(found)
