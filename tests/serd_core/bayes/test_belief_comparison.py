import numpy as np
import pytest

from serd_core.bayes import belief_comparison, evidence_fit
from serd_core.bayes.belief_comparison import compare_beliefs
from serd_core.bayes.draws import posterior_policy
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior.beliefs import FixedBelief, FreeBelief, TiedBelief
from support.small_problems import sampled

N_STATES, N_MODELS = 12, 4


def random_world(seed: int, n_episodes: int, *, wrong: bool):
    """States with random successors, whose outcomes the expert knows or not."""
    rng = np.random.default_rng(seed)
    models = OutcomeModels(
        rng.integers(N_STATES, size=(N_STATES, 3, 3)),
        rng.integers(N_MODELS, size=(N_STATES, 3)),
        np.ones((N_STATES, 3), bool),
        N_MODELS,
    )
    features = np.repeat(rng.normal(size=(N_STATES, 1, 2)), 3, axis=1)
    problem = TabularProblem(Mdp(models, 0.9), features, ("one", "two"))
    truth, other = rng.dirichlet(np.ones(3), (2, N_MODELS))
    policy = soft_policy(problem, np.array([2.0, -1.0]), other if wrong else truth)
    decisions = sampled(problem, policy.probabilities, truth, n_episodes, 15, rng)
    return problem, decisions, truth


@pytest.mark.parametrize(("seed", "wrong"), [(0, False), (1, True)])
def test_the_evidence_finds_whether_the_belief_is_the_truth(seed, wrong):
    problem, decisions, _ = random_world(seed, 40, wrong=wrong)
    found = compare_beliefs(problem, decisions)
    shares = dict(zip(found.relations, found.probabilities, strict=True))
    assert shares[TiedBelief()] < 0.05 if wrong else shares[TiedBelief()] > 0.5
    assert "Bayes factor" in found.sentence()
    named = "independent of the truth" if wrong else "equal to the truth"
    only = compare_beliefs(problem, decisions, (TiedBelief(), FreeBelief()))
    assert only.decided
    assert only.sentence().startswith(f"The expert's belief is {named} (probability ")
    assert len(only.draws(np.random.default_rng(0), 10)) == 10


def test_what_is_undecided_is_averaged():
    problem, decisions, _ = random_world(3, 1, wrong=False)
    found = compare_beliefs(problem, decisions.select(np.arange(2)))
    assert not found.decided
    assert found.sentence().startswith("Undecided: the expert's belief is ")
    draws = found.draws(np.random.default_rng(0), 21)
    assert len(draws) == 21
    with pytest.raises(SerdError, match="n must be a whole number of at least 2, got 1"):
        found.draws(np.random.default_rng(0), 1)
    policy = posterior_policy(problem, draws)
    np.testing.assert_allclose(policy.sum(axis=1), 1.0)


def test_known_dynamics_are_a_relation_too():
    problem, decisions, truth = random_world(0, 10, wrong=False)
    relations = (FixedBelief(), TiedBelief())
    found = compare_beliefs(problem, decisions, relations, dynamics=truth)
    assert found.relations[0] == FixedBelief()
    with pytest.raises(SerdError, match="at least two different beliefs, got 1"):
        compare_beliefs(problem, decisions, (TiedBelief(), TiedBelief()))
    with pytest.raises(SerdError, match="FixedBelief can be compared for known dynamics only"):
        compare_beliefs(problem, decisions, (TiedBelief(), FixedBelief()))


def test_relations_without_a_maximum_are_named(monkeypatch):
    problem, decisions, _ = random_world(0, 2, wrong=False)
    monkeypatch.setattr(evidence_fit, "MAX_NEWTON_STEPS", 0)
    with pytest.raises(SerdError, match=r"a belief equal to the truth \(not converged"):
        compare_beliefs(problem, decisions)


def test_a_relation_without_a_maximum_is_left_out(monkeypatch):
    problem, decisions, _ = random_world(0, 2, wrong=False)
    evidence_of = belief_comparison._log_evidence

    def free_one_fails(found):
        if found.belief == FreeBelief():
            raise SerdError("not converged: out of steps")
        return evidence_of(found)

    monkeypatch.setattr(belief_comparison, "_log_evidence", free_one_fails)
    relations = (FreeBelief(), TiedBelief())
    found = compare_beliefs(problem, decisions, relations)
    assert found.relations == (TiedBelief(),)
    assert found.sentence() == (
        "The expert's belief is taken as equal to the truth. Not compared: independent of the"
        " truth (not converged: out of steps)."
    )
    assert len(found.draws(np.random.default_rng(0), 10)) == 10
