"""Whether joint dynamics contradict moves: evidence by closed form, and experts who are wrong."""

import numpy as np
import pytest
import scipy.special

import serd_core as sc
from lab.posterior.calibration import demonstrated, drawn_truth
from lab.posterior.families import FAMILIES
from support.small_problems import apart, sampled

RNG = np.random.default_rng


def ring(n=8):
    """Either way round, each with a model: on, stay or back; the goal, and a liking of one way."""
    state = np.arange(n)
    ways = [((state + step) % n, state, (state - step) % n) for step in (1, -1)]
    successors = np.stack([np.stack(way, axis=1) for way in ways], axis=1)
    models = sc.OutcomeModels(successors, np.tile([0, 1], (n, 1)), np.ones((n, 2), bool), 2)
    features = np.zeros((n, 2, 1))
    features[0, :, 0] = 1.0
    return sc.TabularProblem(sc.Mdp(models, 0.9), features, ("goal",))


TRUTH = np.array([[0.9, 0.05, 0.05], [0.7, 0.2, 0.1]])


def judged(believed, n_episodes=80, seed=0):
    problem = ring()
    policy = sc.soft_policy(problem, np.array([3.0]), believed).probabilities
    decisions = sampled(problem, policy, TRUTH, n_episodes, 8, seed)
    fit = sc.fit_mdce_serd(problem, decisions)
    return sc.judge_joint_dynamics(sc.laplace(problem, decisions, fit), decisions, RNG(seed))


def test_experts_who_believe_the_truth_raise_no_alarm_and_wrong_ones_do():
    right = judged(TRUTH)
    assert right.chosen == "joint"
    assert right.sentence.startswith("rewards and dynamics are learned together (joint)")
    wrong = judged(np.array([[0.05, 0.9, 0.05], [0.9, 0.05, 0.05]]))
    assert wrong.lead_nats > 1.0  # evidence does not show it
    assert wrong.chosen != "joint"
    assert wrong.point == "counted"
    assert "choices contradict" in wrong.sentence
    # Whatever the joint fit claims, the moves of the counted fit are those that were seen.
    np.testing.assert_allclose(wrong.counted.outcome_probabilities, TRUTH, atol=0.15)


def test_choices_of_experts_who_believe_the_truth_cost_nothing_on_average():
    """The law that makes cost a statistic, with the prior that the worlds are drawn from."""
    given, family, costs = sc.PriorByEvidence(2.0, 1.0), FAMILIES["random MDP"](), []
    for seed in range(40):
        rng = RNG([5, seed])
        decisions = demonstrated(family, *drawn_truth(family, rng), rng)
        fit = sc.fit_mdce_serd(family.problem, decisions, prior=given)
        posterior = sc.laplace(family.problem, decisions, fit)
        costs.append(sc.judge_joint_dynamics(posterior, decisions, rng).cost_nats)
    assert abs(np.mean(costs)) < 3.0 * np.std(costs) / np.sqrt(len(costs))


def test_without_choices_the_evidence_of_both_is_that_of_the_counts():
    """One action: dynamics and rewards do not inform each other."""
    successors = np.zeros((2, 1, 2), int)
    successors[0, 0], successors[1, 0] = [0, 1], 1
    models = sc.OutcomeModels(successors, np.zeros((2, 1), int), np.ones((2, 1), bool), 1)
    problem = sc.TabularProblem(sc.Mdp(models, 0.5), np.ones((2, 1, 1)), ("constant",))
    decisions = apart(0, 0, np.repeat([0, 1], [9, 3]))
    given = sc.PriorByEvidence(pseudo_count=1.5)
    fit = sc.fit_mdce_serd(problem, decisions, prior=given)
    posterior = sc.laplace(problem, decisions, fit)
    found = sc.judge_joint_dynamics(posterior, decisions, RNG(0))
    assert found.lead_nats == pytest.approx(0.0, abs=0.01)
    assert found.cost_nats == pytest.approx(0.0, abs=0.5)
    assert found.action_nats == pytest.approx(found.uniform_nats, abs=1e-6)
    assert found.chosen == "joint"
    exact = scipy.special.betaln(10.5, 4.5) - scipy.special.betaln(1.5, 1.5)
    assert posterior.log_evidence == pytest.approx(exact, abs=0.01)


def test_beliefs_apart_and_hidden_actions_are_exempt():
    problem = ring()
    decisions = sampled(problem, np.full((8, 2), 0.5), TRUTH, 5, 8)
    posterior = sc.laplace(problem, decisions, sc.fit_under_counts(problem, decisions))
    with pytest.raises(sc.SerdError, match=r"must have a TiedBelief .* got FixedBelief and 0 hidd"):
        sc.judge_joint_dynamics(posterior, decisions, RNG(0))
