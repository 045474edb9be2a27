"""SERD from states alone: where states reveal actions, where they do not, and what is recovered."""

import numpy as np
import pytest

from serd_core.bayes.draws import credible_intervals, laplace_draws
from serd_core.bayes.laplace import laplace
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.decisions import HIDDEN, Decisions
from serd_core.demonstrations.observations import explained
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.grid.grid import Grid
from serd_core.learners.behavioural_cloning import clone_behaviour
from serd_core.learners.mdce_irl import fit_mdce_irl_by_entropy, fit_mdce_irl_by_likelihood
from serd_core.learners.serd import fit_mdce_serd, fit_pm_serd
from serd_core.learners.start import dynamics_of_hidden_actions
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.solved_policy import boltzmann_policy, soft_policy
from serd_core.posterior.beliefs import CoupledBelief, FixedBelief, FreeBelief, TiedBelief
from serd_core.posterior.parameters import Block
from serd_core.priors.dirichlet import DirichletPrior
from serd_core.priors.gaussian import GaussianPrior
from serd_core.priors.prior import UniformPrior
from serd_core.selection.evaluation import validation_log_likelihood
from serd_core.uncertainty.identifiability import identifiability
from serd_core.uncertainty.information import fit_information
from support.small_problems import apart, sampled

PRIOR = GaussianPrior(3.0, Block.REWARD) + DirichletPrior(1.0)
#: Stay, forward, right, back, left on open ground and in the forest.
TERRAINS = np.array([[0.04, 0.74, 0.10, 0.02, 0.10], [0.29, 0.31, 0.175, 0.05, 0.175]])


def ring(discount=0.8):
    """Six states; the first action leads one or two on, the second one or two back."""
    states, ahead = np.arange(6)[:, None], np.array([1, 2])
    successors = np.stack([states + ahead, states - ahead], axis=1) % 6
    models = OutcomeModels(successors, [[0, 1]] * 6, np.ones((6, 2), bool), 2)
    features = np.zeros((6, 2, 2))
    features[0, :, 0], features[:, 1, 1] = 1.0, 1.0
    return TabularProblem(Mdp(models, discount), features, ("home", "back"))


def terrain_world(side):
    """Two terrains, four directions, outcomes relative to the direction."""
    grid = Grid((0, 0), 1.0, np.ones((side, side), bool))
    brightness = np.random.default_rng(0).random(grid.n_states)
    states, turns = np.arange(grid.n_states)[:, None], np.arange(4)
    successors = np.empty((grid.n_states, 4, 5), int)
    successors[:, :, 0] = states
    for action in range(4):
        successors[:, action, 1:] = grid.neighbours[states, (action + turns) % 4 + 1]
    model_of = np.repeat((brightness < 0.5)[:, None], 4, axis=1).astype(int)
    models = OutcomeModels(
        successors, model_of, np.ones((grid.n_states, 4), bool), 2, intended=[1, 1]
    )
    features = np.zeros((grid.n_states, 4, 2))
    features[-(side // 2), :, 0], features[:, :, 1] = 1.0, brightness[:, None]
    return TabularProblem(Mdp(models, 0.9), features, ("goal", "brightness"))


@pytest.mark.parametrize(
    ("fit", "belief"),
    [
        (fit_mdce_serd, TiedBelief()),
        (fit_mdce_serd, CoupledBelief(2.0)),
        (fit_pm_serd, FreeBelief()),
    ],
)
def test_where_states_reveal_actions_the_optimum_is_that_of_shown_actions(fit, belief):
    problem, table = ring(), np.array([[0.7, 0.3], [0.6, 0.4]])
    policy = soft_policy(problem, np.array([1.5, -0.5]), table).probabilities
    decisions = sampled(problem, policy, table, 40, 10)
    prior = PRIOR + DirichletPrior(1.0, Block.BELIEF)
    if fit is fit_pm_serd:
        prior = prior + GaussianPrior(0.1, Block.POLICY, 1.0)
    some = np.arange(len(decisions)) % 2 == 0
    start = {"initial_weights": np.ones(2), "dynamics": np.full((2, 2), 0.5)}
    shown, mixed, hidden = (
        fit(problem, each, belief=belief, prior=prior, **start)
        for each in (
            decisions,
            decisions.with_hidden_actions(some),
            decisions.with_hidden_actions(),
        )
    )
    for other in (mixed, hidden):
        assert other.converged
        assert other.objective == pytest.approx(shown.objective, rel=1e-9)
        np.testing.assert_allclose(other.reward_weights, shown.reward_weights, atol=1e-6)
        np.testing.assert_allclose(
            other.outcome_probabilities, shown.outcome_probabilities, atol=1e-6
        )


def test_rewards_and_dynamics_are_recovered_from_states_alone():
    """Intervals of 99 % hold the truth, and are not so wide as to hold everything."""
    problem, weights = terrain_world(7), np.array([4.0, 2.0])
    policy = soft_policy(problem, weights, TERRAINS).probabilities
    hidden = sampled(problem, policy, TERRAINS, 300, 15).with_hidden_actions()
    fit = fit_mdce_serd(problem, hidden)
    assert fit.converged
    draws = laplace_draws(laplace(problem, hidden, fit), np.random.default_rng(0), 1000)
    found = credible_intervals(draws, 0.99)
    for truth, (lower, upper) in (
        (weights, found.reward),
        (TERRAINS[:, 1], found.outcome_probabilities[:, :, 1]),
    ):
        assert np.all((lower < truth) & (truth < upper))
        assert np.all(upper - lower < truth)
    exact = validation_log_likelihood(problem, hidden, fit)
    assert exact == pytest.approx(fit.hidden_log_likelihood / len(hidden))


def test_temperature_and_dynamics_are_learned_from_states_alone():
    """PM SERD: states after known certain moves reveal the actions of a Boltzmann expert."""
    problem, table = ring(), np.array([[0.7, 0.3], [0.6, 0.4]])
    policy = boltzmann_policy(problem, np.array([2.0, -1.0]), table, 1.0).probabilities
    hidden = sampled(problem, policy, table, 300, 10)
    fit = fit_pm_serd(
        problem,
        hidden.with_hidden_actions(),
        initial_weights=np.ones(2),
        dynamics=np.full((2, 2), 0.5),
        prior=PRIOR + GaussianPrior(0.1, Block.POLICY, 1.0),
    )
    np.testing.assert_allclose(fit.outcome_probabilities, table, atol=0.04)
    np.testing.assert_allclose(fit.reward_weights / fit.temperature, [2.0, -1.0], atol=0.3)


def test_what_states_alone_do_not_determine_is_named(minimum_example):
    """Moves from state 1 show one mixture of two outcome models under an unknown policy."""
    decisions = apart(0, HIDDEN, [0] * 4 + [1] * 6)
    fit = fit_mdce_serd(
        minimum_example,
        decisions,
        initial_weights=np.array([0.5]),
        dynamics=np.array([[0.6, 0.4], [0.3, 0.7]]),
        prior=UniformPrior(),
    )
    assert not fit.converged
    assert "nothing determines" in fit.message
    named = " ".join(fit.undetermined)
    for part in ("reward state", "dynamics model 0", "dynamics model 1"):
        assert part in named
    found = identifiability(fit_information(minimum_example, decisions, fit))
    assert len(found.null) == 2


def test_a_fit_of_hidden_actions_needs_a_start():
    problem = ring()
    decisions = Decisions([0], [0.0], [0], [HIDDEN], [1])
    with pytest.raises(SerdError, match="dynamics must be given as a start"):
        fit_mdce_serd(problem, decisions)


def test_a_fit_starts_at_counted_dynamics_or_where_intended_outcomes_are_likely():
    """The forest is in no decision with its action."""
    problem = terrain_world(5)
    models = problem.mdp.transitions
    open_cell = int(np.flatnonzero(models.model_of[:, 0] == 0)[0])
    ahead = models.successors[open_cell, 0, 1]
    decisions = Decisions(
        [0, 1], [0.0, 0.0], [open_cell, open_cell], [0, HIDDEN], [ahead, open_cell]
    )
    start = dynamics_of_hidden_actions(problem, decisions)
    np.testing.assert_allclose(start[1], [0.025, 0.9, 0.025, 0.025, 0.025])
    shown = estimate_dynamics(problem, decisions.select([0]))
    np.testing.assert_allclose(start[0], shown[0])
    np.testing.assert_allclose(
        dynamics_of_hidden_actions(problem, decisions.select([1]))[0], start[1]
    )


@pytest.mark.parametrize(
    "learner",
    [estimate_dynamics, clone_behaviour, fit_mdce_irl_by_likelihood, fit_mdce_irl_by_entropy],
)
def test_learners_that_count_actions_reject_hidden_ones(learner):
    decisions = Decisions([0, 0], [0.0, 1.0], [0, 1], [0, HIDDEN], [1, 2])
    arguments = {"initial_weights": np.zeros(2)} if "fit" in learner.__name__ else {}
    with pytest.raises(SerdError, match=r"action\[1\] must be known for .*, got a hidden one"):
        learner(ring(), decisions, **arguments)


def test_rewards_are_learned_from_states_under_given_dynamics():
    """IRL by likelihood needs no counts where the dynamics are given."""
    problem, table = ring(), np.array([[0.7, 0.3], [0.6, 0.4]])
    policy = soft_policy(problem, np.array([1.5, -0.5]), table).probabilities
    decisions = sampled(problem, policy, table, 40, 10)
    shown, hidden = (
        fit_mdce_irl_by_likelihood(
            problem, each, dynamics=table, initial_weights=np.zeros(2), prior=PRIOR
        )
        for each in (decisions, decisions.with_hidden_actions())
    )
    np.testing.assert_allclose(hidden.reward_weights, shown.reward_weights, atol=1e-6)


def test_hidden_moves_that_no_action_explains_are_found():
    decisions = Decisions([0, 0], [0.0, 1.0], [0, 0], [HIDDEN, HIDDEN], [1, 3])
    np.testing.assert_array_equal(explained(ring().mdp, decisions), [True, False])
    with pytest.raises(SerdError, match=r"decisions\[1\] reaches state 3 .* by any action"):
        fit_mdce_serd(ring(), decisions, dynamics=np.full((2, 2), 0.5))


@pytest.mark.parametrize("prior", [UniformPrior(), PriorByEvidence()])
def test_hidden_actions_under_dynamics_that_are_not_learned_need_dynamics(gridworld, prior):
    hidden = gridworld.decisions.with_hidden_actions()
    with pytest.raises(SerdError, match=r"action\[0\] must be .* one; pass dynamics, or"):
        fit_mdce_serd(
            gridworld.problem,
            hidden,
            initial_weights=np.zeros(2),
            belief=FixedBelief(),
            prior=prior,
        )
