import numpy as np
import pytest

import serd_core as sc
from serd_core.demonstrations.decisions import Decisions, start_distribution, state_action_counts
from serd_core.demonstrations.observations import observe
from serd_core.demonstrations.simulation import feature_counts, trajectories_of
from support.small_problems import sampled


def test_sampled_frequencies_approach_policy_and_dynamics(minimum_example):
    policy = np.array([[0.8, 0.2, 0.0], [0.0, 0.0, 1.0]])
    table = np.array([[1 / 3, 2 / 3], [0.9, 0.1]])
    decisions = sampled(minimum_example, policy, table, 20_000, 1, 0, [1.0, 0.0])
    counts = state_action_counts(decisions, 2, 3)
    assert counts[0, 0] / 20_000 == pytest.approx(0.8, abs=0.01)
    chose_a = decisions.action == 0
    assert decisions.next_state[chose_a].mean() == pytest.approx(2 / 3, abs=0.01)


def test_episodes_are_connected_and_end_where_nothing_leaves(gridworld, minimum_example):
    decisions = gridworld.decisions
    same = decisions.episode[1:] == decisions.episode[:-1]
    assert np.all(decisions.next_state[:-1][same] == decisions.state[1:][same])
    observe(gridworld.problem, decisions)
    policy = np.array([[1.0, 0, 0], [0, 0, 1.0]])
    ended = sampled(minimum_example, policy, np.full((2, 2), 0.5), 50, 100)
    assert np.all(ended.state == 0)


def test_an_expert_that_stays_but_still_chooses_goes_on_deciding():
    """One state that both actions keep: nothing leaves it, but the choice there is informative."""
    problem = sc.from_transitions(np.ones((1, 2, 1)), np.ones((1, 2, 1)), discount=0.9)
    decisions = sampled(problem, np.array([[0.25, 0.75]]), None, 400, 10)
    assert len(decisions) == 4000
    assert decisions.action.mean() == pytest.approx(0.75, abs=0.03)


def test_a_start_is_needed_where_all_states_are_final():
    mdp = sc.from_transitions(np.eye(2)[:, None], np.ones((2, 1)), discount=0.9).mdp
    size = {"n_episodes": 1, "n_steps": 1, "rng": np.random.default_rng(0)}
    assert len(sc.sample_decisions(mdp, np.ones((2, 1)), None, [1.0, 0.0], **size)) == 0
    with pytest.raises(sc.SerdError, match=r"mdp must have a state that is not final .* got 2 fin"):
        sc.sample_decisions(mdp, np.ones((2, 1)), **size)


def one_way(dropped: tuple[int, ...] = (), period_s: float = 2.0) -> Decisions:
    """From 0 to 6 in six decisions of episode 5, some of which are missing."""
    state = np.arange(6)
    every = Decisions(
        np.full(6, 5), 10 + period_s * state, state, np.zeros(6, int), state + 1, "by hand"
    )
    return every.select(~np.isin(state, dropped))


def with_rows(decisions: Decisions, **columns) -> Decisions:
    return Decisions(**decisions.columns() | columns)


def test_rows_in_any_order_are_the_same_trajectories(gridworld):
    decisions = gridworld.decisions
    mixed = decisions.select(np.random.default_rng(0).permutation(len(decisions)))
    one, other = trajectories_of(decisions), trajectories_of(mixed)
    for name in ("episode", "start", "end", "length"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    np.testing.assert_allclose(
        feature_counts(gridworld.problem, mixed), feature_counts(gridworld.problem, decisions)
    )


@pytest.mark.parametrize("dropped", [(2,), (2, 3)])
def test_a_trajectory_begins_anew_after_missing_decisions(dropped):
    decisions = one_way(dropped)
    tracks = trajectories_of(decisions)
    np.testing.assert_array_equal(tracks.start, [0, dropped[-1] + 1])
    np.testing.assert_array_equal(tracks.end, [2, 6])
    np.testing.assert_array_equal(tracks.episode, [5, 5])
    np.testing.assert_array_equal(tracks.step, [0, 1, *range(6 - dropped[-1] - 1)])
    np.testing.assert_allclose(start_distribution(decisions, 7)[tracks.start], 0.5)


def test_a_trajectory_goes_on_where_states_follow_whatever_the_times():
    paused = with_rows(one_way(), time_s=[0.0, 2, 4, 16, 18, 20])
    tracks = trajectories_of(paused)
    assert (len(tracks), tracks.start[0], tracks.end[0], tracks.length[0]) == (1, 0, 6, 6)
    timeless = with_rows(one_way((2,)), time_s=np.zeros(5))
    np.testing.assert_array_equal(trajectories_of(timeless).start, [0, 3])
