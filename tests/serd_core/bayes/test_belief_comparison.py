import numpy as np
import pytest

import serd_core as sc
from serd_core.bayes import belief_comparison, evidence_fit
from support.small_problems import sampled

N_STATES, N_MODELS = 12, 4
TIED_OR_FREE = sc.TiedBelief(), sc.FreeBelief()


def random_world(seed, n_episodes, wrong=False):
    """States with random successors, whose outcomes the expert knows or not."""
    rng = np.random.default_rng(seed)
    successors = rng.integers(N_STATES, size=(N_STATES, 3, 3))
    model_of = rng.integers(N_MODELS, size=(N_STATES, 3))
    models = sc.OutcomeModels(successors, model_of, np.ones((N_STATES, 3), bool), N_MODELS)
    features = np.repeat(rng.normal(size=(N_STATES, 1, 2)), 3, axis=1)
    problem = sc.TabularProblem(sc.Mdp(models, 0.9), features, ("one", "two"))
    truth, other = rng.dirichlet(np.ones(3), (2, N_MODELS))
    policy = sc.soft_policy(problem, np.array([2.0, -1.0]), other if wrong else truth)
    decisions = sampled(problem, policy.probabilities, truth, n_episodes, 15, rng)
    return problem, decisions, truth


@pytest.mark.parametrize(("seed", "wrong"), [(0, False), (1, True)])
def test_the_evidence_finds_whether_the_belief_is_the_truth(seed, wrong):
    problem, decisions, _ = random_world(seed, 40, wrong)
    found = sc.compare_beliefs(problem, decisions)
    shares = dict(zip(found.relations, found.probabilities, strict=True))
    assert shares[sc.TiedBelief()] < 0.05 if wrong else shares[sc.TiedBelief()] > 0.5
    only = sc.compare_beliefs(problem, decisions, TIED_OR_FREE)
    assert only.decided
    named = "independent of the truth" if wrong else "equal to the truth"
    assert only.sentence().startswith(f"The expert's belief is {named} (probability ")
    assert "Bayes factor" in only.sentence()
    assert len(only.draws(np.random.default_rng(0), 10)) == 10


def test_what_is_undecided_is_averaged():
    problem, decisions, _ = random_world(3, 1)
    found = sc.compare_beliefs(problem, decisions.select([0, 1]), TIED_OR_FREE)
    assert not found.decided
    assert found.sentence().startswith("Undecided: the expert's belief is ")
    draws = found.draws(np.random.default_rng(0), 21)
    assert len(draws) == 21
    np.testing.assert_allclose(sc.posterior_policy(problem, draws).sum(axis=1), 1.0)
    with pytest.raises(sc.SerdError, match="n must be a whole number of at least 2, got 1"):
        found.draws(np.random.default_rng(0), 1)


def test_known_dynamics_are_a_relation_too():
    problem, decisions, truth = random_world(0, 10)
    relations = sc.FixedBelief(), sc.TiedBelief()
    found = sc.compare_beliefs(problem, decisions, relations, dynamics=truth)
    assert found.relations[0] == sc.FixedBelief()
    with pytest.raises(sc.SerdError, match="at least two different beliefs, got 1"):
        sc.compare_beliefs(problem, decisions, relations[:1] * 2)
    with pytest.raises(sc.SerdError, match="FixedBelief can be compared for known dynamics only"):
        sc.compare_beliefs(problem, decisions, relations)


def test_relations_without_a_maximum_are_left_out_and_named(monkeypatch):
    problem, decisions, _ = random_world(0, 2)
    evidence_of = belief_comparison._log_evidence

    def free_one_fails(found):
        if found.belief == sc.FreeBelief():
            raise sc.SerdError("not converged: out of steps")
        return evidence_of(found)

    with monkeypatch.context() as patch:
        patch.setattr(belief_comparison, "_log_evidence", free_one_fails)
        found = sc.compare_beliefs(problem, decisions, TIED_OR_FREE)
    assert found.relations == (sc.TiedBelief(),)
    assert found.sentence() == (
        "The expert's belief is taken as equal to the truth. Not compared: independent of the"
        " truth (not converged: out of steps)."
    )
    assert len(found.draws(np.random.default_rng(0), 10)) == 10
    monkeypatch.setattr(evidence_fit, "MAX_NEWTON_STEPS", 0)
    with pytest.raises(sc.SerdError, match=r"a belief equal to the truth \(not converged"):
        sc.compare_beliefs(problem, decisions)
