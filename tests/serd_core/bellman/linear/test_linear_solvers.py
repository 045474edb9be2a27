import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.bellman.bellman_solver import BellmanProblem
from serd_core.bellman.equations import SoftBellman
from serd_core.bellman.linear.automatic import Automatic
from serd_core.bellman.linear.krylov import Krylov
from serd_core.bellman.linear.linear_solver import WithFallback
from serd_core.bellman.linear.lu import BandedLu, SparseLu
from serd_core.bellman.newton import Newton
from serd_core.dynamics.transition_model import transitions_of
from serd_core.errors import SerdError
from support import graphs

WIDE = Automatic(small_states=0, widest_band=0)
SOLVERS = [SparseLu(), BandedLu(), Krylov(), Krylov(fill=5.0), Automatic(), WIDE]
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
    pattern = mdp.engine.pattern
    return pattern, pattern.system_data(policy, entries, 0.95), dense


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_the_pattern_holds_the_matrix_of_the_definition(random_problem, seed):
    pattern, data, dense = random_system(random_problem, seed)
    np.testing.assert_allclose(pattern.matrix(data).toarray(), dense, atol=1e-14)
    order = pattern.elimination.order
    np.testing.assert_allclose(
        pattern.elimination.matrix(data).toarray(), dense[np.ix_(order, order)], atol=1e-14
    )
    assert sorted(order) == list(range(len(dense)))
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


@pytest.mark.parametrize("solver", [Krylov(), Krylov(fill=10.0), BandedLu(), WIDE], ids=repr)
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
    ("grid", 2_500, 1e4, BandedLu()),
    ("grid", 10_000, 10.0, Krylov()),
    ("grid", 10_000, 1e4, SparseLu()),
    ("random graph", 400, 1e4, SparseLu()),
    ("random graph", 2_500, 1e4, Krylov()),
    ("cube", 10_000, 1e4, Krylov()),
    ("tree", 2_500, 1e4, SparseLu()),
    ("star", 2_500, 1e4, Krylov()),
    ("ring", 10_000, 10.0, BandedLu()),
]


def pattern_of(graph, n_states):
    return graphs.mdp_of(graphs.GRAPHS[graph](n_states), 0.9).engine.pattern


@pytest.mark.parametrize(("graph", "n_states", "horizon", "chosen"), GRAPHS)
def test_the_choice_follows_graph_and_horizon(graph, n_states, horizon, chosen):
    assert Automatic().choose(pattern_of(graph, n_states), horizon) == chosen


def test_beyond_the_largest_factor_the_horizon_alone_counts():
    pattern, automatic = pattern_of("ring", 600), Automatic(largest_lu_states=599)
    assert automatic.choose(pattern, 100.0) == Krylov()
    assert automatic.choose(pattern, 1e4) == Krylov(fill=10.0)


def test_a_singular_band_is_refused(make_gridworld):
    pattern = make_gridworld(side=4, n_episodes=1, n_steps=1).problem.mdp.engine.pattern
    with pytest.raises(SerdError, match="must be invertible, but pivot 1 of its band is 0"):
        BandedLu().prepare(pattern, np.zeros(len(pattern.column)))


def test_krylov_says_when_it_did_not_get_there_and_lu_stands_by(make_gridworld):
    case = make_gridworld(side=12, discount=0.9999, n_episodes=1, n_steps=1)
    mdp = case.problem.mdp
    entries = mdp.transitions.entries(case.probabilities)
    pattern = mdp.engine.pattern
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
