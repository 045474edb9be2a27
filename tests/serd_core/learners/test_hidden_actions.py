"""SERD from states alone: where states reveal actions, where they do not, and what is recovered."""

import numpy as np
import pytest

import serd_core as sc
from serd_core.grid.grid import Grid
from serd_core.learners.start import dynamics_of_hidden_actions
from support.small_problems import apart, sampled

PRIOR = sc.GaussianPrior(3.0, sc.Block.REWARD) + sc.DirichletPrior(1.0)
SCALE = sc.GaussianPrior(0.1, sc.Block.POLICY, 1.0)
#: Stay, forward, right, back, left on open ground and in the forest.
TERRAINS = np.array([[0.04, 0.74, 0.10, 0.02, 0.10], [0.29, 0.31, 0.175, 0.05, 0.175]])
TABLE = np.array([[0.7, 0.3], [0.6, 0.4]])


def ring():
    """Six states; the first action leads one or two on, the second one or two back."""
    states, ahead = np.arange(6)[:, None], np.array([1, 2])
    successors = np.stack([states + ahead, states - ahead], axis=1) % 6
    models = sc.OutcomeModels(successors, [[0, 1]] * 6, np.ones((6, 2), bool), 2)
    features = np.zeros((6, 2, 2))
    features[0, :, 0], features[:, 1, 1] = 1.0, 1.0
    return sc.TabularProblem(sc.Mdp(models, 0.8), features, ("home", "back"))


def terrain_world(side):
    """Two terrains, four directions, outcomes relative to the direction."""
    grid = Grid((0, 0), 1.0, np.ones((side, side), bool))
    n, brightness = grid.n_states, np.random.default_rng(0).random(grid.n_states)
    states, turns = np.arange(n)[:, None], np.arange(4)
    successors = np.repeat(states[:, :, None], 4, axis=1).repeat(5, axis=2)
    for action in range(4):
        successors[:, action, 1:] = grid.neighbours[states, (action + turns) % 4 + 1]
    model_of = np.repeat((brightness < 0.5)[:, None], 4, axis=1).astype(int)
    models = sc.OutcomeModels(successors, model_of, np.ones((n, 4), bool), 2, intended=[1, 1])
    features = np.zeros((n, 4, 2))
    features[-(side // 2), :, 0], features[:, :, 1] = 1.0, brightness[:, None]
    return sc.TabularProblem(sc.Mdp(models, 0.9), features, ("goal", "brightness"))


def shown_in_ring():
    problem = ring()
    policy = sc.soft_policy(problem, np.array([1.5, -0.5]), TABLE).probabilities
    return problem, sampled(problem, policy, TABLE, 40, 10)


@pytest.mark.parametrize(
    ("fit", "belief", "dynamics"),
    [
        (sc.fit_mdce_serd, sc.CoupledBelief(2.0), np.full((2, 2), 0.5)),
        (sc.fit_pm_serd, sc.FreeBelief(), np.full((2, 2), 0.5)),
        # Learning rewards alone needs no counts where the dynamics are given.
        (sc.fit_mdce_serd, sc.FixedBelief(), TABLE),
    ],
)
def test_where_states_reveal_actions_the_optimum_is_that_of_shown_actions(fit, belief, dynamics):
    problem, decisions = shown_in_ring()
    prior = PRIOR + sc.DirichletPrior(1.0, sc.Block.BELIEF)
    prior = prior + SCALE if fit is sc.fit_pm_serd else prior
    some = np.arange(len(decisions)) % 2 == 0
    start = {"initial_weights": np.ones(2), "dynamics": dynamics}
    seen = decisions, decisions.with_hidden_actions(some), decisions.with_hidden_actions()
    shown, mixed, hidden = (fit(problem, d, belief=belief, prior=prior, **start) for d in seen)
    for other in (mixed, hidden):
        assert other.converged
        assert other.objective == pytest.approx(shown.objective, rel=1e-9)
        np.testing.assert_allclose(other.reward_weights, shown.reward_weights, atol=1e-6)
        learned = other.outcome_probabilities
        np.testing.assert_allclose(learned, shown.outcome_probabilities, atol=1e-6)


ENDS = [0.005, 0.995]


def test_rewards_and_dynamics_are_recovered_from_states_alone():
    """Intervals of 99 % hold the truth, and are not so wide as to hold everything."""
    problem, weights = terrain_world(7), np.array([4.0, 2.0])
    policy = sc.soft_policy(problem, weights, TERRAINS).probabilities
    hidden = sampled(problem, policy, TERRAINS, 300, 15).with_hidden_actions()
    fit = sc.fit_mdce_serd(problem, hidden)
    assert fit.converged
    draws = sc.laplace_draws(sc.laplace(problem, hidden, fit), np.random.default_rng(0), 600)
    for truth, (lower, upper) in (
        (weights, np.quantile(draws.reward, ENDS, axis=0)),
        (TERRAINS[:, 1], np.quantile(draws.outcome_probabilities[:, :, 1], ENDS, axis=0)),
    ):
        assert np.all((lower < truth) & (truth < upper))
        assert np.all(upper - lower < truth)
    exact = sc.validation_log_likelihood(problem, hidden, fit)
    assert exact == pytest.approx(fit.hidden_log_likelihood / len(hidden))


def test_what_states_alone_do_not_determine_is_named(minimum_example):
    """Moves from state 1 show one mixture of two outcome models under an unknown policy."""
    decisions = apart(0, sc.HIDDEN, [0] * 4 + [1] * 6)
    start = {"initial_weights": [0.5], "dynamics": [[0.6, 0.4], [0.3, 0.7]]}
    fit = sc.fit_mdce_serd(minimum_example, decisions, prior=sc.UniformPrior(), **start)
    assert not fit.converged
    assert "nothing determines" in fit.message
    named = " ".join(fit.undetermined)
    for part in ("reward state", "dynamics model 0", "dynamics model 1"):
        assert part in named
    found = sc.identifiability(sc.fit_information(minimum_example, decisions, fit))
    assert len(found.null) == 2


def test_a_fit_starts_at_counted_dynamics_or_where_intended_outcomes_are_likely():
    """The forest is in no decision with its action."""
    problem = terrain_world(5)
    models = problem.mdp.transitions
    cell = int(np.flatnonzero(models.model_of[:, 0] == 0)[0])
    decisions = apart(cell, [0, sc.HIDDEN], [models.successors[cell, 0, 1], cell])
    start = dynamics_of_hidden_actions(problem, decisions)
    np.testing.assert_allclose(start[1], [0.025, 0.9, 0.025, 0.025, 0.025])
    shown = sc.estimate_dynamics(problem, decisions.select([0]))
    np.testing.assert_allclose(start[0], shown[0])
    alone = dynamics_of_hidden_actions(problem, decisions.select([1]))
    np.testing.assert_allclose(alone[0], start[1])
    with pytest.raises(sc.SerdError, match="dynamics must be given as a start"):
        sc.fit_mdce_serd(ring(), apart([0], sc.HIDDEN, [1]))


@pytest.mark.parametrize("prior", [sc.UniformPrior(), sc.PriorByEvidence()])
def test_hidden_actions_under_dynamics_that_are_not_learned_need_dynamics(gridworld, prior):
    hidden = gridworld.decisions.with_hidden_actions()
    given = {"initial_weights": np.zeros(2), "belief": sc.FixedBelief(), "prior": prior}
    with pytest.raises(sc.SerdError, match=r"action\[0\] must be .* one; pass dynamics, or"):
        sc.fit_mdce_serd(gridworld.problem, hidden, **given)
