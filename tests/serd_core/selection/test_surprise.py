import numpy as np
import pytest
from scipy.stats import kstest

import serd_core as sc
from serd_core.selection.evaluation import episode_scores, tail_probabilities
from support.small_problems import apart, sampled

#: Action a fails always, b succeeds in 3 of 4 cases, both are chosen alike.
CHOICE = np.array([[0.5, 0.5, 0.0], [0.0, 0.0, 1.0]])
UNIFORM, TABLE = np.full((25, 5), 0.2), np.array([[1.0, 0.0], [0.25, 0.75]])


@pytest.mark.parametrize("hide", [False, True])
def test_ranks_of_the_models_own_episodes_are_uniform_and_those_of_others_are_not(
    make_gridworld, hide
):
    case = make_gridworld(n_episodes=300, n_steps=12)
    problem, table = case.problem, case.probabilities
    own = sc.soft_policy(problem, case.weights, table).probabilities
    other = sc.soft_policy(problem, -case.weights, table).probabilities
    rng = np.random.default_rng(3)
    strange = sampled(problem, other, table, 100, 12, rng)
    scores = []
    for decisions in (case.decisions, strange):
        shown = decisions.with_hidden_actions() if hide else decisions
        scores.append(episode_scores(problem, shown, own, table, n_simulated=99, rng=rng))
    usual, unusual = scores
    assert kstest(usual.rank, "uniform").pvalue > 0.01
    assert kstest(unusual.rank, "uniform").pvalue < 1e-6
    assert np.mean(unusual.rank < 0.05) > 0.3
    assert usual.expected.mean() == pytest.approx(usual.log_likelihood.mean(), abs=0.05)


def test_a_score_is_the_mean_log_likelihood_of_its_decisions(gridworld):
    problem, table, rng = gridworld.problem, gridworld.probabilities, np.random.default_rng(0)
    policy = sc.soft_policy(problem, gridworld.weights, table).probabilities
    shuffled = gridworld.decisions.select(rng.permutation(len(gridworld.decisions)))
    found = episode_scores(problem, shuffled, policy, table, n_simulated=3, rng=rng)
    each = sc.move_log_likelihood(problem, gridworld.decisions, policy, table)
    for number, score in zip(found.episode, found.log_likelihood, strict=True):
        assert score == pytest.approx(each[gridworld.decisions.episode == number].mean())
    np.testing.assert_array_equal(found.n_decisions, 15)


def test_the_tail_counts_what_is_as_likely_or_less(minimum_example):
    rows = [(0, 0), (1, 1), (1, 0), (0, 1), (sc.HIDDEN, 0), (sc.HIDDEN, 1)]
    decisions = apart(0, *zip(*rows, strict=True))
    found = tail_probabilities(minimum_example, decisions, CHOICE, TABLE)
    np.testing.assert_allclose(found, [1.0, 0.5, 0.125, 0.0, 1.0, 0.375])
    likelihood = np.exp(sc.move_log_likelihood(minimum_example, decisions, CHOICE, TABLE))
    np.testing.assert_allclose(likelihood, [0.5, 0.375, 0.125, 0.0, 0.625, 0.375])
    with pytest.raises(sc.SerdError, match=r"state\[0\] must be a state from 0 to 1, got 5"):
        sc.move_log_likelihood(minimum_example, apart([5], [0], [0]), CHOICE, TABLE)


def test_an_episode_that_the_model_rules_out_has_rank_zero_or_close(minimum_example):
    impossible, rng = apart([0], [0], [1]), np.random.default_rng(0)
    case = minimum_example, impossible, CHOICE, TABLE
    found = episode_scores(*case, n_simulated=50, rng=rng)
    assert found.log_likelihood[0] == -np.inf
    assert found.rank[0] < 1 / 51
    with pytest.raises(sc.SerdError, match="n_simulated must be at least 1, got 0"):
        episode_scores(*case, n_simulated=0, rng=rng)


def test_episodes_without_simulated_counterparts_are_rejected(gridworld, minimum_example):
    rng = np.random.default_rng(0)
    mixed = gridworld.decisions.with_hidden_actions(np.arange(300) == 20)
    with pytest.raises(sc.SerdError, match=r"must all show or all hide .* got both in episode 1"):
        episode_scores(gridworld.problem, mixed, UNIFORM, gridworld.probabilities, rng=rng)
    stays = sc.Decisions([7], [0.0], [1], [2], [1])
    with pytest.raises(sc.SerdError, match=r"must not start in a final state.* got episode 7 in"):
        episode_scores(minimum_example, stays, CHOICE, TABLE, rng=rng)
