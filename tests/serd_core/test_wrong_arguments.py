"""Arguments that used to fail deep inside are rejected by name, rule, value and fix."""

import numpy as np
import pytest

import serd_core as sc
from serd_core import arrays


@pytest.mark.parametrize("solve", [sc.soft_policy, sc.optimal_policy])
def test_weights_whose_values_overflow_are_rejected(gridworld, solve):
    problem, table = gridworld.problem, gridworld.probabilities
    for size in (1e308, 1e300):
        for weights in ([0.0, size], [size, -size]):
            with pytest.raises(
                sc.SerdError, match=r"rewards\[\d+, \d\] must be finite and at most"
            ):
                solve(problem, weights, table)
    with pytest.raises(sc.SerdError, match="problem must have an mdp and feature_names, got a Mdp"):
        solve(problem.mdp, [0.0, 1.0], table)
    assert np.all(np.isfinite(solve(problem, [0.0, 1e298], table).probabilities))


def test_two_decisions_of_one_episode_and_time_are_rejected(gridworld):
    given = gridworld.decisions
    twice = given.select(np.append(np.arange(len(given)), 3))
    with pytest.raises(sc.SerdError, match=r"got decisions\[3\] and decisions\[300\] both in epis"):
        sc.fit_mdce_serd(gridworld.problem, twice)


LISTED = [0, 0, 1, 1], [0, 1, 0, 1], [0, 1, 1, 0]


def test_what_would_not_fit_into_memory_is_refused_with_the_bytes_it_needs(gridworld, monkeypatch):
    problem = gridworld.problem
    monkeypatch.setattr(arrays, "memory_limit", lambda: 30_000)
    with pytest.raises(
        sc.SerdError,
        match=r"the transitions of 25 states and 5 actions must fit into memory, but needs"
        r" 5.62e\+04 bytes of 3e\+04; use fewer states",
    ):
        sc.Mdp(problem.mdp.transitions, 0.9)
    with pytest.raises(sc.SerdError, match="second derivatives by 47 parameters over 25 states"):
        sc.fit_mdce_serd(problem, gridworld.decisions)
    monkeypatch.setattr(arrays, "memory_limit", lambda: 799)  # entry by entry is more
    with pytest.raises(sc.SerdError, match=r"must fit into memory, but needs 800 bytes of 799"):
        sc.Mdp(sc.fixed_transitions((2, 2), *LISTED, np.ones(4)), 0.9)


@pytest.mark.parametrize("shape", [(10**12 + 1, 1), (1, 10**12 + 1)], ids=["states", "actions"])
def test_numbers_of_states_with_gaps_are_refused_before_memory_is_used(shape):
    with pytest.raises(sc.SerdError, match=r"fit into memory.* number states and actions from"):
        sc.fixed_transitions(shape, [0], [0], [0], [1.0])


def test_one_goal_that_is_no_list_of_pairs_is_rejected(gridworld):
    with pytest.raises(sc.SerdError, match=r"goals must list pairs .* pass \[\(problem,"):
        sc.fit_several_goals((gridworld.problem, gridworld.decisions))
