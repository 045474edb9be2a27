import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.bellman.bellman_solver import BellmanProblem, Newton
from serd_core.bellman.equations import SoftBellman
from serd_core.bellman.linear_solvers import Automatic, BandedLu, Krylov, SparseLu, WithFallback
from serd_core.dynamics.transition_model import transitions_of
from serd_core.errors import SerdError
from support import graphs

WIDE = Automatic(largest_lu_states=0, widest_band=0)
SOLVERS = [SparseLu(), BandedLu(), Krylov(), WIDE]
EACH_SOLVER = pytest.mark.parametrize("solver", SOLVERS, ids=repr)


def random_system(random_problem, seed):
    problem, table = random_problem(seed, 0.95)
    mdp = problem.mdp
    rng = np.random.default_rng(seed)
    policy = rng.random(mdp.available.shape) * mdp.available
    policy /= policy.sum(axis=1, keepdims=True)
    entries = mdp.transitions.entries(table)
    chosen = mdp.transitions.matrix(entries).toarray().reshape(*mdp.available.shape, -1)
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


@EACH_SOLVER
@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_solutions_are_those_of_the_dense_solver(random_problem, solver, seed):
    pattern, data, dense = random_system(random_problem, seed)
    right_side = np.random.default_rng(seed).normal(size=(len(dense), 3))
    system = solver.prepare(pattern, data)
    np.testing.assert_array_equal(system.solve(np.zeros(len(dense))), 0)
    np.testing.assert_allclose(
        system.solve(right_side), np.linalg.solve(dense, right_side), atol=1e-7
    )
    np.testing.assert_allclose(
        system.solve(right_side[:, 0], transposed=True),
        np.linalg.solve(dense.T, right_side[:, 0]),
        atol=1e-7,
    )


@pytest.mark.parametrize("solver", [Krylov(), BandedLu(), WIDE], ids=repr)
def test_newton_reaches_its_accuracy_with_every_linear_solver(make_gridworld, solver):
    case = make_gridworld(side=30, discount=0.99, n_episodes=1, n_steps=1)
    mdp, rewards = case.problem.mdp, case.problem.features @ case.weights
    transitions = transitions_of(mdp.transitions, case.probabilities)
    posed = BellmanProblem(SoftBellman(), rewards, transitions, mdp)
    exact = Newton(linear_solver=SparseLu()).solve(posed)
    other = Newton(linear_solver=solver).solve(posed)
    assert other.converged
    np.testing.assert_allclose(other.value, exact.value, rtol=1e-10)


GRAPHS = [
    ("ring", 10_000, BandedLu(), BandedLu()),
    ("grid", 2_500, BandedLu(), BandedLu()),
    ("grid", 4_900, SparseLu(), SparseLu()),
    ("grid", 5_041, Krylov(), SparseLu()),
    ("random graph", 400, SparseLu(), SparseLu()),
    ("random graph", 2_500, Krylov(), Krylov()),
    ("tree", 4_900, Krylov(), Krylov()),
    ("cube", 3_375, SparseLu(), SparseLu()),
]


def pattern_of(graph, n_states):
    return graphs.mdp_of(graphs.GRAPHS[graph](n_states), 0.9).transitions.policy_pattern


@pytest.mark.parametrize(("graph", "n_states", "for_one", "for_many"), GRAPHS)
def test_the_choice_follows_the_graph_and_the_number_of_right_hand_sides(
    graph, n_states, for_one, for_many
):
    pattern = pattern_of(graph, n_states)
    assert Automatic().choose(pattern) == Automatic().for_systems(right_sides=10).choose(pattern)
    assert Automatic().choose(pattern) == for_one
    assert Automatic().for_systems(right_sides=11).choose(pattern) == for_many


def test_a_singular_band_is_refused(make_gridworld):
    pattern = make_gridworld(side=4, n_episodes=1, n_steps=1).problem.mdp.transitions.policy_pattern
    with pytest.raises(SerdError, match="must be invertible, but pivot 1 of its band is 0"):
        BandedLu().prepare(pattern, np.zeros(len(pattern.column)))


def test_krylov_says_when_it_did_not_get_there_and_lu_stands_by(make_gridworld):
    case = make_gridworld(side=12, discount=0.9999, n_episodes=1, n_steps=1)
    mdp = case.problem.mdp
    entries = mdp.transitions.entries(case.probabilities)
    pattern = mdp.transitions.policy_pattern
    data = pattern.system_data(mdp.available / 5.0, entries, 0.9999)
    right_side = np.random.default_rng(0).normal(size=144)
    weak = Krylov(max_iterations=2, max_runs=1).prepare(pattern, data)
    with pytest.raises(SerdError, match="Krylov must reach a relative residual of 1e-11, got"):
        weak.solve(right_side)
    exact = SparseLu().prepare(pattern, data)
    helped = WithFallback(weak, SparseLu(), pattern, data)
    assert helped.solver_of_next(Krylov()) == Krylov()
    np.testing.assert_allclose(helped.solve(right_side), exact.solve(right_side))
    np.testing.assert_allclose(
        helped.solve(right_side, transposed=True), exact.solve(right_side, transposed=True)
    )
    assert helped.solver_of_next(Krylov()) == SparseLu()
