import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import serd_core as sc
from serd_core.bellman import bellman_solver, linear_solvers
from serd_core.bellman.linear_solvers import BandedFactor, KrylovSystem, LuFactor, kind_of
from serd_core.dynamics.transition_model import Transitions
from serd_core.errors import SerdError
from support import graphs


def random_system(random_problem, seed):
    problem, table = random_problem(seed, 0.95)
    mdp = problem.mdp
    rng = np.random.default_rng(seed)
    policy = rng.random(mdp.available.shape) * mdp.available
    policy /= policy.sum(axis=1, keepdims=True)
    entries = mdp.transitions.entries(table)
    chosen = Transitions(mdp.transitions, table).matrix.toarray().reshape(*mdp.available.shape, -1)
    dense = np.eye(mdp.n_states) - 0.95 * np.einsum("sa,sat->st", policy, chosen)
    pattern = mdp.transitions.policy_pattern
    return pattern, pattern.system_data(policy, entries, 0.95), dense


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_the_pattern_holds_the_matrix_of_the_definition(random_problem, seed):
    pattern, data, dense = random_system(random_problem, seed)
    np.testing.assert_allclose(pattern.matrix(data).toarray(), dense, atol=1e-14)
    band = pattern.band
    assert sorted(band.order) == list(range(len(dense)))
    filled = band.filled(data)
    for row, column in np.argwhere(dense[np.ix_(band.order, band.order)]):
        assert filled[band.below + band.above + column - row, row] == pytest.approx(
            dense[band.order[row], band.order[column]], abs=1e-14
        )


@pytest.mark.parametrize("kind", [LuFactor, BandedFactor, KrylovSystem])
@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_solutions_are_those_of_the_dense_solver(random_problem, kind, seed):
    pattern, data, dense = random_system(random_problem, seed)
    right_side = np.random.default_rng(seed).normal(size=(len(dense), 3))
    system = kind(pattern, data)
    np.testing.assert_array_equal(system.solve(np.zeros(len(dense))), 0)
    exact = np.linalg.solve(dense, right_side)
    np.testing.assert_allclose(system.solve(right_side), exact, atol=1e-7)
    exact = np.linalg.solve(dense.T, right_side[:, 0])
    solved = system.solve(right_side[:, 0], transposed=True)
    np.testing.assert_allclose(solved, exact, atol=1e-7)


@pytest.mark.parametrize("kind", [KrylovSystem, BandedFactor])
def test_newton_reaches_its_accuracy_with_every_linear_solver(make_gridworld, kind, monkeypatch):
    case = make_gridworld(side=30, discount=0.99, n_episodes=1, n_steps=1)
    given, found = (case.problem, case.weights, case.probabilities), []
    for each in (LuFactor, kind):
        monkeypatch.setattr(bellman_solver, "kind_of", lambda *_, each=each: each)
        found.append(sc.soft_policy(*given))
    assert found[1].converged
    np.testing.assert_allclose(found[1].value, found[0].value, rtol=1e-10)


GRAPHS = [
    ("ring", 10_000, BandedFactor, BandedFactor),
    ("grid", 2_500, BandedFactor, BandedFactor),
    ("grid", 4_900, LuFactor, LuFactor),
    ("grid", 5_041, KrylovSystem, LuFactor),
    ("random graph", 400, LuFactor, LuFactor),
    ("random graph", 2_500, KrylovSystem, KrylovSystem),
    ("tree", 4_900, KrylovSystem, KrylovSystem),
    ("cube", 3_375, LuFactor, LuFactor),
]


def pattern_of(graph, n_states):
    return graphs.mdp_of(graphs.GRAPHS[graph](n_states), 0.9).transitions.policy_pattern


@pytest.mark.parametrize(("graph", "n_states", "for_one", "for_many"), GRAPHS)
def test_the_choice_follows_the_graph_and_the_number_of_right_hand_sides(
    graph, n_states, for_one, for_many
):
    pattern = pattern_of(graph, n_states)
    kinds = [kind_of(pattern, n) for n in (1, 10, 11)]
    assert kinds == [for_one, for_one, for_many]


def test_a_singular_band_is_refused(make_gridworld):
    pattern = make_gridworld(side=4, n_episodes=1, n_steps=1).problem.mdp.transitions.policy_pattern
    with pytest.raises(SerdError, match="must be invertible, but pivot 1 of its band is 0"):
        BandedFactor(pattern, np.zeros(len(pattern.column)))


def test_a_factor_stands_by_where_krylov_does_not_get_there(make_gridworld, monkeypatch):
    case = make_gridworld(side=12, discount=0.9999, n_episodes=1, n_steps=1)
    mdp = case.problem.mdp
    entries = mdp.transitions.entries(case.probabilities)
    pattern = mdp.transitions.policy_pattern
    data = pattern.system_data(mdp.available / 5.0, entries, 0.9999)
    right_side = np.random.default_rng(0).normal(size=144)
    monkeypatch.setattr(linear_solvers, "MAX_ITERATIONS", 2)
    monkeypatch.setattr(linear_solvers, "MAX_RUNS", 1)
    helped, exact = KrylovSystem(pattern, data), LuFactor(pattern, data)
    for transposed in (False, True):
        solved = (each.solve(right_side, transposed=transposed) for each in (helped, exact))
        np.testing.assert_allclose(*solved)
