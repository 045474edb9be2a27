import numpy as np
import pytest

import serd_core as sc
from serd_core.dynamics.estimation import outcome_models_of
from support.small_problems import sampled

N_STATES, N_ACTIONS, K = 4, 2, 3
DISCOUNT = 0.9


def ring_problems():
    """Each action leads to the state itself or a neighbour: entry by entry, and as outcome models.

    Each pair has an outcome model of its own.
    """
    rng = np.random.default_rng(0)
    own = np.arange(N_STATES)
    successors = (own[:, None, None] + np.array([0, 1, -1])) % N_STATES
    successors = np.repeat(successors, N_ACTIONS, axis=1)
    table = rng.dirichlet(np.ones(K), size=(N_STATES, N_ACTIONS))
    dense = np.zeros((N_STATES, N_ACTIONS, N_STATES))
    np.put_along_axis(dense, successors, table, axis=2)
    features = rng.normal(size=(N_STATES, N_ACTIONS, 2))
    listed = sc.from_transitions(dense, features, discount=DISCOUNT, learned=True)
    models = sc.OutcomeModels(
        successors,
        np.arange(N_STATES * N_ACTIONS).reshape(N_STATES, N_ACTIONS),
        np.ones((N_STATES, N_ACTIONS), dtype=bool),
        N_STATES * N_ACTIONS,
    )
    shared = sc.TabularProblem(sc.Mdp(models, DISCOUNT), features, listed.feature_names)
    known = sc.from_transitions(dense, features, discount=DISCOUNT)
    policy = sc.soft_policy(known, [1.0, -1.0]).probabilities
    decisions = sampled(known, policy, None, 30, 20, rng)
    return listed, shared, decisions, dense


def dense_of(problem, parameters):
    model = problem.mdp.transitions
    probabilities = model.local_probabilities(parameters)
    return model.matrix(model.entries(probabilities)).toarray().reshape(N_STATES, N_ACTIONS, -1)


@pytest.mark.parametrize("pseudo_count", [0.2, 1.0, 7.0])
def test_the_estimate_is_the_mean_of_the_dirichlet_posterior(pseudo_count):
    listed, _, decisions, dense = ring_problems()
    counts = np.zeros_like(dense)
    np.add.at(counts, (decisions.state, decisions.action, decisions.next_state), 1.0)
    wanted = np.where(dense > 0, counts + pseudo_count, 0.0)
    wanted /= wanted.sum(axis=2, keepdims=True)
    estimate = sc.estimate_dynamics(listed, decisions, pseudo_count)
    np.testing.assert_allclose(dense_of(listed, estimate), wanted, rtol=1e-12)


def test_outcome_models_of_single_pairs_have_the_same_estimates_and_fits():
    listed, shared, decisions, _ = ring_problems()
    of_pairs = sc.estimate_dynamics(shared, decisions, 0.7)
    expected = shared.mdp.transitions.parameters_of(of_pairs)
    estimate = sc.estimate_dynamics(listed, decisions, 0.7)
    np.testing.assert_allclose(
        dense_of(listed, estimate), dense_of(shared, expected), rtol=1e-8, atol=1e-12
    )
    prior = sc.DirichletPrior(0.7) + sc.GaussianPrior(3.0, sc.Block.REWARD)
    fits = [
        sc.fit_mdce_serd(
            each, decisions, prior=prior, initial_weights=np.zeros(2), ascent=sc.TrustRegion()
        )
        for each in (listed, shared)
    ]
    assert all(fit.converged for fit in fits)
    np.testing.assert_allclose(fits[0].reward_weights, fits[1].reward_weights, atol=1e-5)
    assert fits[0].objective == pytest.approx(fits[1].objective, abs=1e-7)
    np.testing.assert_allclose(
        dense_of(listed, fits[0].parameters.truth),
        dense_of(shared, fits[1].parameters.truth),
        atol=1e-5,
    )


def test_transitions_that_are_listed_twice_count_once():
    model = sc.learned_transitions((2, 1), [0, 0, 0, 1], [0, 0, 0, 0], [1, 0, 1, 1])
    assert model.n_parameters == 1
    np.testing.assert_allclose(model.local_probabilities(np.array([np.log(3.0)])), [0.25, 0.75, 1])


def test_wrong_arguments_are_rejected_by_name():
    listed, _, decisions, _ = ring_problems()
    start = {"initial_weights": np.zeros(2), "belief": sc.FixedBelief(), "prior": sc.UniformPrior()}
    for call, sentence in (
        (lambda: sc.estimate_dynamics(listed, decisions, 0), "pseudo_count must be finite and ab"),
        (
            lambda: sc.fit_mdce_serd(listed, decisions),
            "PriorByEvidence is a prior of OutcomeM",
        ),
        (lambda: outcome_models_of(listed.mdp), "dynamics must be OutcomeModels here, got Sp"),
        (
            lambda: sc.fit_mdce_serd(listed, decisions, dynamics=np.ones(24), **start),
            r"must be its \(16,\) parameters, not its entries",
        ),
    ):
        with pytest.raises(sc.SerdError, match=sentence):
            call()
