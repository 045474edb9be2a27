"""`converged` holds at a maximum only, and its message names what is missing."""

import re
from dataclasses import replace

import numpy as np
import pytest

import serd_core as sc
from serd_core.learners import certificate
from support.small_problems import apart, fit_of

LIKELY = sc.fit_mdce_irl_by_likelihood


def test_a_small_feature_does_not_pass_for_a_small_gradient(gridworld):
    """With values of 1e-8 the gradient at the start is within the tolerance of the ascent."""
    factors = np.array([1e-8, 1.0])
    scaled = replace(gridworld.problem, features=gridworld.problem.features * factors)
    fit = fit_of(gridworld, [0.0, 0.0], fit=LIKELY)
    same = fit_of(replace(gridworld, problem=scaled), [0.0, 0.0], fit=LIKELY)
    assert fit.converged
    assert same.converged
    np.testing.assert_allclose(same.reward_weights * factors, fit.reward_weights, rtol=1e-3)


def test_an_outcome_model_that_no_pair_has_may_be_anything(gridworld):
    problem = gridworld.problem
    models = replace(problem.mdp.transitions, n_models=10)
    larger = replace(problem, mdp=replace(problem.mdp, transitions=models))
    prior = sc.KldPrior(0.1, np.full((10, 5), 0.2))
    fit = fit_of(replace(gridworld, problem=larger), [0.0, 0.0], prior=prior)
    assert fit.converged
    assert fit.undetermined == ()
    np.testing.assert_allclose(fit.outcome_probabilities[9], 0.2)


#: Converged wherever it starts.
STAYS = sc.Lbfgs(gradient_tolerance=1e6)


def test_a_saddle_is_left_and_named_where_no_step_leaves_it(minimum_example, monkeypatch):
    """At equal dynamics the gradient by the reward vanishes, and the log posterior bends up."""
    given = {
        "initial_weights": np.zeros(1),
        "dynamics": np.full((2, 2), 0.5),
        "prior": sc.GaussianPrior(2.0, sc.Block.REWARD) + sc.GaussianPrior(1.0, sc.Block.TRUTH),
    }
    decisions = apart(0, 0, [0, 1, 1] * 10)
    fit = sc.fit_mdce_serd(minimum_example, decisions, **given)
    assert fit.converged
    assert abs(fit.reward_weights[0]) > 0.1
    monkeypatch.setattr(certificate, "FINAL_STEPS", 0)
    fit = sc.fit_mdce_serd(minimum_example, decisions, ascent=STAYS, **given)
    assert not fit.converged
    assert re.search(r"bends up along .*\(a saddle point\)", fit.message)


def random_case(kind, seed=0):
    """Decisions by weights 1 and -1; other kinds differ in one way.

    separable: the optimal policy's. avoided: a third feature of an action that is never taken.
    zero, constant, sum: a third feature of that value.
    """
    rng = np.random.default_rng(seed)
    moves, features = rng.dirichlet(np.full(10, 0.3), size=(10, 3)), rng.normal(size=(10, 3, 2))
    mdp = sc.from_transitions(moves, features, discount=0.8).mdp
    problem = sc.TabularProblem(mdp, features, ("one", "two"))
    solve = sc.optimal_policy if kind == "separable" else sc.soft_policy
    policy = solve(problem, [1.0, -1.0]).probabilities
    third = {
        "avoided": np.broadcast_to([0.0, 0.0, 1.0], (10, 3)),
        "zero": np.zeros((10, 3)),
        "constant": np.ones((10, 3)),
        "sum": features @ [1.0, -2.0],
    }
    if kind in third:
        wider = np.concatenate([features, third[kind][:, :, None]], axis=2)
        problem = sc.TabularProblem(mdp, wider, ("one", "two", "third"))
    if kind == "avoided":
        policy = policy * [1.0, 1.0, 0.0]
        policy = policy / policy.sum(axis=1, keepdims=True)
    rng = np.random.default_rng(100 + seed)
    return problem, sc.sample_decisions(mdp, policy, n_episodes=40, n_steps=15, rng=rng)


#: Holds the scale that rewards and temperature have in common.
SCALE = sc.GaussianPrior(0.1, sc.Block.POLICY, 1.0)


def by_relative_entropy(problem, decisions, threshold=0.0, **start):
    """The fit by samples of a uniform policy."""
    uniform, rng = np.full((10, 3), 1 / 3), np.random.default_rng(9)
    samples = sc.sample_decisions(problem.mdp, uniform, n_episodes=1500, n_steps=15, rng=rng)
    thresholds = np.full(len(problem.feature_names), threshold)
    given = {"samples": samples, "sampling_policy": uniform, "thresholds": thresholds}
    return sc.fit_relative_entropy_irl(problem, decisions, **given, **start)


def by_policy_matching_serd(problem, decisions, prior=SCALE, **start):
    return sc.fit_pm_serd(problem, decisions, belief=sc.FixedBelief(), prior=prior, **start)


def by_several_goals(problem, decisions, initial_weights):
    del initial_weights
    return sc.fit_several_goals([(problem, decisions)])


def started(learner, problem, decisions, **options):
    start = np.full(len(problem.feature_names), 0.1)
    return learner(problem, decisions, initial_weights=start, **options)


LIKELIHOODS = (LIKELY, by_policy_matching_serd, by_several_goals)
MATCHING = (sc.fit_mdce_irl_by_entropy, sc.fit_maxent_irl, by_relative_entropy)
LEARNERS = (*LIKELIHOODS, *MATCHING, sc.fit_policy_matching)


@pytest.mark.parametrize("learner", LEARNERS)
def test_learners_converge_where_decisions_determine_all_weights(learner):
    fit = started(learner, *random_case("plain"))
    assert fit.converged, fit.message


@pytest.mark.parametrize("learner", [*LIKELIHOODS, sc.fit_policy_matching])
def test_separable_decisions_are_no_convergence_and_their_direction_is_named(learner):
    """Weights grow on and on in the ratio of those that made the decisions."""
    fit = started(learner, *random_case("separable"))
    assert not fit.converged
    parts = re.findall(r"([-+]\d\.\d\d) reward (one|two)", fit.message)
    signs = {name: np.sign(float(part)) for part, name in parts}
    assert signs == {"one": 1.0, "two": -1.0}, fit.message
    if learner is not by_several_goals:
        assert "(separable decisions)" in fit.message
    if learner is sc.fit_policy_matching:
        assert fit.message.endswith("use fit_mdce_irl_by_likelihood with prior=PriorByEvidence()")


@pytest.mark.parametrize(
    ("learner", "kind"),
    [
        *zip(LEARNERS, ["zero", "constant", "sum"] * 2 + ["zero"], strict=True),
        (sc.fit_mdce_irl_by_entropy, "constant"),
    ],
)
def test_a_weight_that_nothing_determines_is_no_convergence_and_is_named(learner, kind):
    fit = started(learner, *random_case(kind))
    assert not fit.converged
    assert re.search(r"nothing determines [^;]*reward third", fit.message), fit.message
    if learner is not by_several_goals:
        assert any("reward third" in direction for direction in fit.undetermined)


@pytest.mark.parametrize("learner", LEARNERS[:-1])
def test_a_feature_that_no_demonstration_has_is_no_convergence_and_is_named(learner):
    fit = started(learner, *random_case("avoided"))
    assert not fit.converged
    assert "-1.00 reward third" in fit.message, fit.message


def test_the_scale_that_rewards_and_temperature_have_in_common_is_named():
    fit = started(by_policy_matching_serd, *random_case("plain"), prior=sc.UniformPrior())
    assert not fit.converged
    assert "log temperature" in fit.undetermined[0]
    assert "reward one" in fit.undetermined[0]
