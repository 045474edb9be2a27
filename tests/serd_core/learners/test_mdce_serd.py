import numpy as np
import pytest

from serd_core.ascent.lbfgs import Lbfgs
from serd_core.ascent.trust_region import TrustRegion
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.dynamics.sparse_model import SparseModel
from serd_core.errors import SerdError
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior.beliefs import CoupledBelief, FixedBelief, FreeBelief
from serd_core.posterior.parameters import Block
from serd_core.priors.divergence import KldPrior
from serd_core.priors.gaussian import GaussianPrior
from serd_core.priors.prior import UniformPrior
from serd_core.uncertainty.identifiability import identifiability
from serd_core.uncertainty.information import fit_information
from support.small_problems import apart, fit_of, sampled


def test_rewards_and_dynamics_are_recovered_from_many_decisions(make_gridworld):
    case = make_gridworld(side=5, n_episodes=1500, n_steps=40)
    fit = fit_mdce_serd(
        case.problem, case.decisions, initial_weights=np.zeros(2), prior=KldPrior(1e-3)
    )
    assert fit.converged
    np.testing.assert_allclose(fit.reward_weights, case.weights, atol=0.15)
    np.testing.assert_allclose(fit.outcome_probabilities, case.probabilities, atol=0.02)


def test_the_optimum_does_not_depend_on_where_the_weights_start(gridworld):
    fits = [
        fit_mdce_serd(
            gridworld.problem,
            gridworld.decisions,
            rng=np.random.default_rng(seed),
            prior=KldPrior(0.1),
        )
        for seed in (1, 2)
    ]
    assert all(fit.converged for fit in fits)
    np.testing.assert_allclose(fits[0].reward_weights, fits[1].reward_weights, atol=1e-3)
    assert fits[0].objective == pytest.approx(fits[1].objective, abs=1e-5)


@pytest.mark.parametrize("start", [-3.0, 3.0])
def test_both_explanations_of_the_minimum_example_are_found(minimum_example, start):
    """Section 4.6.1: the expert always takes a; what b does is learned from the choice alone."""
    decisions = apart(0, 0, [0, 1, 1] * 10)
    fit = fit_mdce_serd(
        minimum_example, decisions, initial_weights=np.array([start]), prior=KldPrior(1e-3)
    )
    by_a, by_b = fit.outcome_probabilities[:, 1]
    assert np.sign(fit.reward_weights[0]) == np.sign(start)
    assert (by_a > by_b) == (start > 0)
    np.testing.assert_allclose(by_a, 2 / 3, atol=0.05)


def test_a_heavy_divergence_prior_turns_serd_into_irl_with_the_estimated_dynamics(gridworld):
    """Section 5.2: for lambda to infinity MDCE SERD turns to MDCE IRL."""
    heavy = fit_of(
        gridworld, [1.0, 1.0], prior=KldPrior(1e6), ascent=Lbfgs(gradient_tolerance=1e-3)
    )
    fixed = fit_of(gridworld, [1.0, 1.0], belief=FixedBelief(), prior=UniformPrior())
    estimate = estimate_dynamics(gridworld.problem, gridworld.decisions)
    np.testing.assert_allclose(heavy.outcome_probabilities, estimate, atol=1e-3)
    np.testing.assert_allclose(fixed.outcome_probabilities, estimate, rtol=1e-12)
    np.testing.assert_allclose(heavy.reward_weights, fixed.reward_weights, atol=2e-2)


def test_an_expert_with_a_wrong_belief_is_recovered_as_such(make_gridworld):
    """Belief and truth are estimated apart: choices show the one, transitions the other."""
    case = make_gridworld(side=6, n_episodes=1)
    believed = np.clip(case.probabilities, 0.02, None)
    believed[5:] = 0.02
    believed[np.arange(5, 9), np.arange(1, 5)] = 0.92
    believed /= believed.sum(axis=1, keepdims=True)
    policy = soft_policy(case.problem, case.weights, believed).probabilities
    decisions = sampled(case.problem, policy, case.probabilities, 2000, 60)
    fit = fit_mdce_serd(
        case.problem,
        decisions,
        initial_weights=np.ones(2),
        belief=FreeBelief(),
        prior=KldPrior(1e-3),
        ascent=Lbfgs(gradient_tolerance=1e-5),
    )
    forest_believed = fit.believed_outcome_probabilities[np.arange(5, 9), np.arange(1, 5)]
    forest_true = fit.outcome_probabilities[np.arange(5, 9), np.arange(1, 5)]
    np.testing.assert_allclose(forest_true, 0.3, atol=0.02)
    np.testing.assert_allclose(forest_believed, 0.92, atol=0.1)
    np.testing.assert_allclose(fit.reward_weights, case.weights, rtol=0.15)


def test_coupling_leads_from_free_to_tied_blocks(gridworld):
    """A weak coupling prior changes nothing, a strong one makes belief and truth equal."""

    def fit(belief):
        prior = KldPrior(0.1) + KldPrior(0.1, block=Block.BELIEF)
        prior = prior + GaussianPrior(3.0, Block.REWARD)
        return fit_of(gridworld, [1.0, 1.0], belief=belief, prior=prior, ascent=TrustRegion())

    free, weak, strong = (
        fit(belief) for belief in (FreeBelief(), CoupledBelief(1e-7), CoupledBelief(1e4))
    )
    np.testing.assert_allclose(weak.reward_weights, free.reward_weights, atol=1e-3)
    apart = np.abs(free.outcome_probabilities - free.believed_outcome_probabilities).max()
    together = np.abs(strong.outcome_probabilities - strong.believed_outcome_probabilities).max()
    assert apart > 0.1
    assert together < 1e-2


def test_progress_is_reported_and_a_fit_can_be_stopped(gridworld):
    seen = []

    def stop_at_three(step):
        seen.append(step.objective)
        return len(seen) == 3

    fit = fit_of(gridworld, [0.0, 0.0], prior=UniformPrior(), on_step=stop_at_three)
    assert len(seen) == 3
    assert fit.n_steps == 3
    assert not fit.converged
    assert fit.message == "stopped by the callback"
    np.testing.assert_allclose(fit.objective_trace, np.array(seen) * len(gridworld.decisions))


def test_parts_of_the_objective_add_up_and_are_those_of_the_last_step(gridworld):
    fit = fit_mdce_serd(
        gridworld.problem, gridworld.decisions, initial_weights=np.zeros(2), prior=KldPrior(0.5)
    )
    parts = fit.policy_log_likelihood + fit.dynamics_log_likelihood + fit.log_prior
    assert fit.objective == pytest.approx(parts)
    assert fit.objective == pytest.approx(fit.objective_trace[-1])
    assert fit.log_prior < 0
    assert np.all(np.diff(fit.objective_trace) > -1e-6)
    np.testing.assert_allclose(fit.outcome_probabilities.sum(axis=1), 1)


def test_a_general_sparse_model_with_its_own_parameters_fits_the_same_learner():
    """One parameter: the probability 1 / (1 + exp(-theta)) of moving on, in any state."""

    def entries(theta):
        onward = 1 / (1 + np.exp(-theta[0]))
        return np.array([onward, 1 - onward, 1.0, onward, 1 - onward, 1.0])

    def vector_jacobian(theta, gradient):
        onward = 1 / (1 + np.exp(-theta[0]))
        slope = onward * (1 - onward)
        return np.array([slope * (gradient[0] - gradient[1] + gradient[3] - gradient[4])])

    model = SparseModel(
        n_pairs=(3, 2),
        state=[0, 0, 0, 1, 1, 2],
        action=[0, 0, 1, 0, 0, 0],
        next_state=[1, 0, 0, 2, 1, 2],
        parameter_count=1,
        probabilities=entries,
        vector_jacobian=vector_jacobian,
    )
    features = np.zeros((3, 2, 1))
    features[2] = 1.0
    problem = TabularProblem(Mdp(model, 0.9), features, ("goal",))
    truth = entries(np.array([0.4]))
    policy = soft_policy(problem, np.array([1.5]), truth).probabilities
    decisions = sampled(problem, policy, truth, 4000, 20, 1, [1.0, 0, 0])
    fits = [
        fit_mdce_serd(
            problem,
            decisions,
            initial_weights=np.zeros(1),
            dynamics=np.zeros(1),
            ascent=ascent,
        )
        for ascent in (Lbfgs(), TrustRegion())
    ]
    for fit in fits:
        assert fit.converged
        assert fit.reward_weights[0] == pytest.approx(1.5, abs=0.1)
        assert fit.parameters.truth == pytest.approx(0.4, abs=0.1)
    assert fits[1].n_steps < fits[0].n_steps
    information = fit_information(problem, decisions, fits[1])
    assert information.names == ("reward goal", "dynamics parameter 0")
    assert identifiability(information).identified
    # The prior adds c to both transitions of either pair, which share the parameter.
    moves = decisions.select((decisions.action == 0) & (decisions.state < 2))
    onward = float(np.sum(moves.next_state == moves.state + 1)), float(len(moves))
    share = (onward[0] + 2 * 1.5) / (onward[1] + 4 * 1.5)
    estimate = estimate_dynamics(problem, decisions, pseudo_count=1.5)
    np.testing.assert_allclose(entries(estimate)[0], share, rtol=1e-7)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"prior": UniformPrior()}, "initial_weights or rng must be given, got neither"),
        ({"initial_weights": np.zeros(3)}, r"initial_weights must have shape \(2\), got \(3,\)"),
        ({"initial_weights": [0.0, np.nan]}, r"initial_weights\[1\] must be finite, got nan"),
        ({"dynamics": np.full((2, 5), 0.2)}, r"outcome probabilities must have shape \(9, 5\)"),
        ({"dynamics": np.full((9, 5), 0.3)}, r"outcome probabilities\[0\] must sum to 1, got 1.5"),
    ],
)
def test_wrong_starts_are_refused_by_name(gridworld, given, sentence):
    start = {"initial_weights": np.zeros(2)} if "dynamics" in given else {}
    with pytest.raises(SerdError, match=sentence):
        fit_mdce_serd(gridworld.problem, gridworld.decisions, **start, **given)
