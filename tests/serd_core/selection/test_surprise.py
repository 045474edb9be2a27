import numpy as np
import pytest
from scipy.stats import kstest

from serd_core.demonstrations.decisions import HIDDEN, Decisions
from serd_core.errors import SerdError
from serd_core.policies.solved_policy import soft_policy
from serd_core.selection.evaluation import move_log_likelihood
from serd_core.selection.surprise import episode_scores, tail_probabilities
from support.small_problems import apart, sampled


@pytest.mark.parametrize("hide", [False, True])
def test_ranks_of_the_models_own_episodes_are_uniform_and_those_of_others_are_not(
    make_gridworld, hide
):
    case = make_gridworld(n_episodes=300, n_steps=12)
    problem, table = case.problem, case.probabilities
    own = soft_policy(problem, case.weights, table).probabilities
    other = soft_policy(problem, -case.weights, table).probabilities
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
    problem, table = gridworld.problem, gridworld.probabilities
    policy = soft_policy(problem, gridworld.weights, table).probabilities
    shuffled = gridworld.decisions.select(
        np.random.default_rng(0).permutation(len(gridworld.decisions))
    )
    rng = np.random.default_rng(0)
    found = episode_scores(problem, shuffled, policy, table, n_simulated=3, rng=rng)
    each = move_log_likelihood(problem, gridworld.decisions, policy, table)
    for number, score in zip(found.episode, found.log_likelihood, strict=True):
        assert score == pytest.approx(each[gridworld.decisions.episode == number].mean())
    np.testing.assert_array_equal(found.n_decisions, 15)


def test_the_tail_counts_what_is_as_likely_or_less(minimum_example):
    """Action a fails always, b succeeds in 3 of 4 cases, both are chosen alike."""
    policy = np.array([[0.5, 0.5, 0.0], [0.0, 0.0, 1.0]])
    table = np.array([[1.0, 0.0], [0.25, 0.75]])
    rows = [(0, 0), (1, 1), (1, 0), (0, 1), (HIDDEN, 0), (HIDDEN, 1)]
    action, following = zip(*rows, strict=True)
    decisions = apart(0, action, following)
    found = tail_probabilities(minimum_example, decisions, policy, table)
    np.testing.assert_allclose(found, [1.0, 0.5, 0.125, 0.0, 1.0, 0.375])
    likelihood = np.exp(move_log_likelihood(minimum_example, decisions, policy, table))
    np.testing.assert_allclose(likelihood, [0.5, 0.375, 0.125, 0.0, 0.625, 0.375])
    outside = Decisions([0], [0.0], [5], [0], [0])
    with pytest.raises(SerdError, match=r"state\[0\] must be a state from 0 to 1, got 5"):
        move_log_likelihood(minimum_example, outside, policy, table)


def test_an_episode_that_the_model_rules_out_has_rank_zero_or_close(minimum_example):
    policy = np.array([[0.5, 0.5, 0.0], [0.0, 0.0, 1.0]])
    table = np.array([[1.0, 0.0], [0.25, 0.75]])
    impossible = Decisions([0], [0.0], [0], [0], [1])
    rng = np.random.default_rng(0)
    found = episode_scores(minimum_example, impossible, policy, table, n_simulated=50, rng=rng)
    assert found.log_likelihood[0] == -np.inf
    assert found.rank[0] < 1 / 51
    with pytest.raises(SerdError, match="n_simulated must be at least 1, got 0"):
        episode_scores(minimum_example, impossible, policy, table, n_simulated=0, rng=rng)


def test_episodes_without_simulated_counterparts_are_rejected(gridworld, minimum_example):
    policy = soft_policy(gridworld.problem, gridworld.weights, gridworld.probabilities)
    table, rng = gridworld.probabilities, np.random.default_rng(0)
    some = np.arange(len(gridworld.decisions)) == 20
    mixed = gridworld.decisions.with_hidden_actions(some)
    with pytest.raises(SerdError, match=r"must all show or all hide .* got both in episode 1"):
        episode_scores(gridworld.problem, mixed, policy.probabilities, table, rng=rng)
    stays = Decisions([7], [0.0], [1], [2], [1])
    choice = np.array([[0.5, 0.5, 0.0], [0.0, 0.0, 1.0]])
    with pytest.raises(SerdError, match=r"must not start in a final state.* got episode 7 in"):
        episode_scores(minimum_example, stays, choice, np.full((2, 2), 0.5), rng=rng)
