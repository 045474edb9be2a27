"""`converged` holds at a maximum only, and its message names what is missing."""

import re
from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest

from serd_core.ascent.lbfgs import Lbfgs
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.learners import certificate
from serd_core.learners.maxent_irl import fit_maxent_irl
from serd_core.learners.mdce_irl import fit_mdce_irl_by_entropy, fit_mdce_irl_by_likelihood
from serd_core.learners.policy_matching import fit_policy_matching
from serd_core.learners.relative_entropy_irl import fit_relative_entropy_irl
from serd_core.learners.serd import fit_mdce_serd, fit_pm_serd
from serd_core.learners.several_goals import fit_several_goals
from serd_core.mdp.problem import TabularProblem
from serd_core.mdp.tables import from_transitions
from serd_core.policies.solved_policy import optimal_policy, soft_policy
from serd_core.posterior.beliefs import FixedBelief
from serd_core.posterior.parameters import Block
from serd_core.priors.divergence import KldPrior
from serd_core.priors.gaussian import GaussianPrior
from support.small_problems import apart

KNOWN = {"initial_weights": np.zeros(2)}


def with_features(problem: TabularProblem, features: np.ndarray) -> TabularProblem:
    return TabularProblem(problem.mdp, features, problem.feature_names)


def test_a_small_feature_does_not_pass_for_a_small_gradient(gridworld):
    """With values of 1e-8 the gradient at the start is within the tolerance of the ascent."""
    factors = np.array([1e-8, 1.0])
    small = with_features(gridworld.problem, gridworld.problem.features * factors)
    fit = fit_mdce_irl_by_likelihood(gridworld.problem, gridworld.decisions, **KNOWN)
    same = fit_mdce_irl_by_likelihood(small, gridworld.decisions, **KNOWN)
    assert fit.converged
    assert same.converged
    np.testing.assert_allclose(same.reward_weights * factors, fit.reward_weights, rtol=1e-3)


def test_decisions_that_all_agree_are_named_separable(gridworld):
    """Everyone steps to the brightest neighbour, so a larger weight is always more likely."""
    problem = gridworld.problem
    brightness = problem.features[:, 0, 0]
    model = problem.mdp.transitions
    state = np.arange(problem.mdp.n_states)
    ahead = model.successors[state[:, None], np.arange(5), np.arange(5)]
    action = np.argmax(brightness[ahead], axis=1)
    decisions = Decisions(
        state, state * 1.0, state, action, ahead[state, action], "brightest neighbour"
    )
    certain = np.eye(5)[[0, 1, 2, 3, 4, 1, 2, 3, 4]]
    still = replace(problem.mdp, discount=0.3)
    only = TabularProblem(still, problem.features[:, :, :1], ("brightness",))
    fit = fit_mdce_irl_by_likelihood(only, decisions, initial_weights=np.zeros(1), dynamics=certain)
    assert not fit.converged
    assert "grows on and on along +1.00 reward brightness (separable decisions)" in fit.message
    prior = GaussianPrior(3.0, Block.REWARD)
    kept = fit_mdce_irl_by_likelihood(
        only, decisions, initial_weights=np.zeros(1), dynamics=certain, prior=prior
    )
    assert kept.converged
    assert kept.reward_weights[0] > 0


@pytest.mark.parametrize("value", [7e-9, 7.0])
def test_a_feature_that_no_decision_depends_on_is_named(gridworld, value):
    """A feature that is constant adds a constant to all values and changes no choice."""
    features = gridworld.problem.features.copy()
    features[:, :, 1] = value
    constant = with_features(gridworld.problem, features)
    fit = fit_mdce_irl_by_likelihood(constant, gridworld.decisions, **KNOWN)
    assert not fit.converged
    assert "nothing determines" in fit.message
    assert "reward goal" in fit.message
    assert len(fit.undetermined) == 1


def test_an_outcome_model_that_no_pair_has_may_be_anything(gridworld):
    problem = gridworld.problem
    models = replace(problem.mdp.transitions, n_models=10)
    larger = replace(problem, mdp=replace(problem.mdp, transitions=models))
    prior = KldPrior(0.1, np.full((10, 5), 0.2))
    fit = fit_mdce_serd(larger, gridworld.decisions, prior=prior, **KNOWN)
    assert fit.converged
    assert fit.undetermined == ()
    np.testing.assert_allclose(fit.outcome_probabilities[9], 0.2)


def from_the_saddle(problem, **options):
    """A fit that starts where the gradient by the reward vanishes."""
    return fit_mdce_serd(
        problem,
        apart(0, 0, [0, 1, 1] * 10),
        initial_weights=np.zeros(1),
        dynamics=np.full((2, 2), 0.5),
        prior=GaussianPrior(2.0, Block.REWARD) + GaussianPrior(1.0, Block.TRUTH),
        **options,
    )


def test_a_saddle_is_left(minimum_example):
    """At equal dynamics the gradient by the reward vanishes, and the log posterior bends up."""
    fit = from_the_saddle(minimum_example)
    assert fit.converged
    assert abs(fit.reward_weights[0]) > 0.1


#: Converged wherever it starts.
STAYS = Lbfgs(gradient_tolerance=1e6)


def test_a_saddle_is_named_where_no_step_leaves_it(minimum_example, monkeypatch):
    monkeypatch.setattr(certificate, "FINAL_STEPS", 0)
    fit = from_the_saddle(minimum_example, ascent=STAYS)
    assert not fit.converged
    assert "bends up along" in fit.message
    assert "saddle point" in fit.message


def test_a_long_last_step_is_not_called_separable(gridworld, monkeypatch):
    monkeypatch.setattr(certificate, "FINAL_STEPS", 1)
    fit = fit_mdce_irl_by_likelihood(
        gridworld.problem, gridworld.decisions, initial_weights=np.ones(2), ascent=STAYS
    )
    assert not fit.converged
    assert "separable" not in fit.message
    assert "standard errors" in fit.message


def random_case(kind: str, seed: int = 0) -> tuple[TabularProblem, Decisions]:
    """Decisions by weights 1 and -1; other kinds differ in one way.

    separable: the optimal policy's. avoided: a third feature of an action that is never taken.
    zero, constant, sum: a third feature of that value.
    """
    rng = np.random.default_rng(seed)
    moves, features = rng.dirichlet(np.full(10, 0.3), size=(10, 3)), rng.normal(size=(10, 3, 2))
    mdp = from_transitions(moves, features, discount=0.8).mdp
    problem = TabularProblem(mdp, features, ("one", "two"))
    policy = soft_policy(problem, [1.0, -1.0]).probabilities
    if kind == "separable":
        policy = optimal_policy(problem, [1.0, -1.0]).probabilities
    third = {
        "avoided": np.broadcast_to([0.0, 0.0, 1.0], (10, 3)),
        "zero": np.zeros((10, 3)),
        "constant": np.ones((10, 3)),
        "sum": features @ [1.0, -2.0],
    }
    if kind in third:
        wider = np.concatenate([features, third[kind][:, :, None]], axis=2)
        problem = TabularProblem(mdp, wider, ("one", "two", "third"))
    if kind == "avoided":
        policy = policy * [1.0, 1.0, 0.0]
        policy = policy / policy.sum(axis=1, keepdims=True)
    return problem, sample_decisions(
        mdp, policy, n_episodes=40, n_steps=15, rng=np.random.default_rng(100 + seed)
    )


#: Holds the scale that rewards and temperature have in common.
SCALE = GaussianPrior(0.1, Block.POLICY, 1.0)


def by_relative_entropy(problem: TabularProblem, decisions: Decisions, threshold: float):
    """The fit by samples of a uniform policy."""
    uniform, n_features = np.full((10, 3), 1 / 3), len(problem.feature_names)
    return fit_relative_entropy_irl(
        problem,
        decisions,
        samples=sample_decisions(
            problem.mdp, uniform, n_episodes=1500, n_steps=15, rng=np.random.default_rng(9)
        ),
        sampling_policy=uniform,
        thresholds=np.full(n_features, threshold),
        initial_weights=np.full(n_features, 0.1),
    )


def without_prior(name: str, problem: TabularProblem, decisions: Decisions):
    """The fit of a learner without a prior on rewards."""
    start = np.full(len(problem.feature_names), 0.1)
    if name == "relative entropy":
        return by_relative_entropy(problem, decisions, 0.0)
    if name == "several goals":
        return fit_several_goals([(problem, decisions)])
    if name == "policy-matching SERD":
        return fit_pm_serd(
            problem, decisions, initial_weights=start, belief=FixedBelief(), prior=SCALE
        )
    fits = {
        "likelihood": fit_mdce_irl_by_likelihood,
        "entropy": fit_mdce_irl_by_entropy,
        "maximum entropy": fit_maxent_irl,
        "policy matching": fit_policy_matching,
    }
    return fits[name](problem, decisions, initial_weights=start)


LIKELIHOODS = ("likelihood", "policy-matching SERD", "several goals")
MATCHING = ("entropy", "maximum entropy", "relative entropy")
LEARNERS = (*LIKELIHOODS, *MATCHING, "policy matching")


@pytest.mark.parametrize("learner", LEARNERS)
def test_learners_converge_where_decisions_determine_all_weights(learner):
    fit = without_prior(learner, *random_case("plain"))
    assert fit.converged, fit.message


@pytest.mark.parametrize("learner", [*LIKELIHOODS, "policy matching"])
def test_separable_decisions_are_no_convergence_and_their_direction_is_named(learner):
    """Weights grow on and on in the ratio of those that made the decisions."""
    fit = without_prior(learner, *random_case("separable"))
    assert not fit.converged
    parts = re.findall(r"([-+]\d\.\d\d) reward (one|two)", fit.message)
    signs = {name: np.sign(float(part)) for part, name in parts}
    assert signs == {"one": 1.0, "two": -1.0}, fit.message
    if learner != "several goals":
        advice = "use fit_mdce_irl_by_likelihood with prior=PriorByEvidence()"
        assert "(separable decisions)" in fit.message
        assert fit.message.endswith(advice) or learner != "policy matching"


@pytest.mark.parametrize(
    ("learner", "kind"),
    [*zip(LEARNERS, cycle(["zero", "constant", "sum"]), strict=False), ("entropy", "constant")],
)
def test_a_weight_that_nothing_determines_is_no_convergence_and_is_named(learner, kind):
    fit = without_prior(learner, *random_case(kind))
    assert not fit.converged
    assert re.search(r"nothing determines [^;]*reward third", fit.message), fit.message
    if learner != "several goals":
        assert any("reward third" in direction for direction in fit.undetermined)


@pytest.mark.parametrize("learner", LEARNERS[:-1])
def test_a_feature_that_no_demonstration_has_is_no_convergence_and_is_named(learner):
    fit = without_prior(learner, *random_case("avoided"))
    assert not fit.converged
    assert "-1.00 reward third" in fit.message, fit.message


def test_a_squared_loss_may_have_its_minimum_at_a_finite_weight_of_such_a_feature():
    """As the limit is farther from the frequencies in some worlds and closer in others."""
    problem, decisions = random_case("avoided", seed=4)
    fit = without_prior("policy matching", problem, decisions)
    farther = fit_policy_matching(
        problem,
        decisions,
        initial_weights=fit.reward_weights - np.array([0.0, 0.0, 30.0]),
    )
    assert fit.converged == (fit.objective > farther.objective)


def test_what_the_messages_advise_gives_a_fit_that_converges():
    for kind in ("separable", "avoided", "sum"):
        problem, decisions = random_case(kind)
        start = np.full(len(problem.feature_names), 0.1)
        given = {"initial_weights": start}
        fits = [
            fit_mdce_irl_by_likelihood(problem, decisions, prior=PriorByEvidence(), **given),
            fit_mdce_irl_by_entropy(problem, decisions, slack=0.001, **given),
            fit_pm_serd(
                problem,
                decisions,
                belief=FixedBelief(),
                prior=SCALE + GaussianPrior(3.0, Block.REWARD),
                **given,
            ),
        ]
        if kind != "separable":
            fits.append(by_relative_entropy(problem, decisions, 0.1))
        assert all(fit.converged for fit in fits), [fit.message for fit in fits]


def test_the_scale_that_rewards_and_temperature_have_in_common_is_named():
    problem, decisions = random_case("plain")
    fit = fit_pm_serd(problem, decisions, initial_weights=np.ones(2), belief=FixedBelief())
    assert not fit.converged
    assert "log temperature" in fit.undetermined[0]
    assert "reward one" in fit.undetermined[0]
