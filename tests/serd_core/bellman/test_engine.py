"""The compiled engine against SciPy on small problems, and SciPy where it does not work."""

import subprocess
import sys
import warnings
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lab.benchmarks.learning.gridworld_problems import (
    DYNAMICS,
    WEIGHTS,
    demonstrations,
    landscape_problem,
    objective_of,
)
from serd_core.bellman import engine as choice
from serd_core.bellman.bellman_solver import BellmanProblem, ValueIteration, backup
from serd_core.bellman.engine import COMPILED_FROM, Engine, engine_for
from serd_core.bellman.equations import HardBellman, SoftBellman
from serd_core.bellman.linear.krylov import Krylov
from serd_core.bellman.linear.linear_solver import WithFallback
from serd_core.bellman.linear.lu import SparseLu
from serd_core.bellman.linear.policy_pattern import policy_pattern
from serd_core.bellman.newton import Newton
from serd_core.dynamics.sparse_model import fixed_transitions
from serd_core.dynamics.transition_model import transitions_of
from serd_core.learners.start import starting_parameters
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.mdp.problem import rewards as reward_table
from serd_core.posterior.derivatives.posterior_hessian import posterior_hessian

HAS_NUMBA = find_spec("numba") is not None
NEEDS_NUMBA = pytest.mark.skipif(not HAS_NUMBA, reason="numba (the extra `fast`) is not installed")
if HAS_NUMBA:
    from serd_core.bellman.compiled import compiled_engine, swept_bicgstab
    from serd_core.bellman.compiled.compiled_engine import CompiledEngine
    from serd_core.bellman.compiled.swept_bicgstab import Swept, SweptSystem


@pytest.fixture
def untried():
    """No trial of compiled code yet, before and after."""
    choice._compiled_code_works.cache_clear()
    yield
    choice._compiled_code_works.cache_clear()


def compiled(problem):
    """The problem with the compiled engine, whatever its size."""
    mdp = Mdp(problem.mdp.transitions, problem.mdp.discount)
    vars(mdp)["engine"] = engine_for(mdp.transitions, compiled_from=1)
    assert isinstance(mdp.engine, CompiledEngine)
    return TabularProblem(mdp, problem.features, problem.feature_names)


def random_policy(mdp, rng):
    policy = rng.random(mdp.available.shape) * mdp.available
    return policy / policy.sum(axis=1, keepdims=True)


def models(random_problem, seed):
    """The same transitions as outcome models and entry by entry, and as they are believed."""
    problem, table = random_problem(seed)
    model = problem.mdp.transitions
    pairs = np.divmod(model.row, model.n_actions)
    listed = fixed_transitions(model.available.shape, *pairs, model.successor, model.entries(table))
    return transitions_of(model, table), transitions_of(listed, None)


@NEEDS_NUMBA
@settings(deadline=None, max_examples=8)
@given(seed=st.integers(0, 10_000))
def test_compiled_sums_are_those_of_scipy(random_problem, seed):
    rng = np.random.default_rng(seed)
    for transitions in models(random_problem, seed):
        model = transitions.model
        plain, fast = Engine(model), engine_for(model, compiled_from=1)
        value, weights = (
            10.0 * rng.normal(size=model.n_states),
            rng.normal(size=model.available.shape),
        )
        rewards = rng.normal(size=weights.shape)
        for equation in (SoftBellman(), HardBellman()):
            problem = BellmanProblem(equation, rewards, transitions, Mdp(model, 0.95))
            np.testing.assert_allclose(
                fast.q(problem, value), plain.q(problem, value), rtol=1e-10, atol=1e-10
            )
            np.testing.assert_allclose(
                fast.backup(problem, value)[0], plain.backup(problem, value)[0], rtol=1e-12
            )
        np.testing.assert_allclose(
            fast.flow(transitions, weights), plain.flow(transitions, weights), atol=1e-12
        )
        np.testing.assert_allclose(
            fast.local_gradient(transitions, weights, value),
            plain.local_gradient(transitions, weights, value),
            atol=1e-11,
        )


@NEEDS_NUMBA
@settings(deadline=None, max_examples=8)
@given(
    seed=st.integers(0, 10_000),
    discount=st.sampled_from([0.95, 0.999, 0.9995]),
    quick_from=st.sampled_from([0, 1_000]),
)
def test_swept_solutions_are_those_of_the_dense_solver(random_problem, seed, discount, quick_from):
    rng = np.random.default_rng(seed)
    for transitions in models(random_problem, seed):
        model = transitions.model
        policy = random_policy(model, rng)
        fast, right_side = engine_for(model, compiled_from=1), rng.normal(size=model.n_states)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(swept_bicgstab, "MOST_CROSSING", 1.0)
            swept = Swept(Krylov(), SparseLu(), quick_from)
            system = fast.system(transitions, policy, discount, swept)
        chosen = (policy.reshape(-1, 1) * transitions.matrix.toarray()).reshape(*policy.shape, -1)
        dense = np.eye(model.n_states) - discount * chosen.sum(axis=1)
        atol = 1e-9 / (1.0 - discount)
        np.testing.assert_allclose(
            system.solve(right_side), np.linalg.solve(dense, right_side), atol=atol
        )
        np.testing.assert_allclose(
            system.solve(right_side, transposed=True),
            np.linalg.solve(dense.T, right_side),
            atol=atol,
        )


@NEEDS_NUMBA
@pytest.mark.parametrize("n_states", [2, 3, 41])
def test_the_factor_of_a_chain_is_exact(n_states):
    rng, own = np.random.default_rng(n_states), np.arange(n_states)
    successor = np.clip(own[:, None] + np.array([-1, 0, 1]), 0, n_states - 1).ravel()
    pattern = policy_pattern(np.repeat(own, 3), successor, n_states, 1)
    entries = rng.dirichlet(np.ones(3), size=n_states).ravel()
    data = pattern.system_data(np.ones((n_states, 1)), entries, 0.99)
    matrix, right_side = pattern.matrix(data), rng.normal(size=n_states)
    dense = matrix.toarray()
    for transposed in (False, True):
        system = SweptSystem(Krylov(max_iterations=1, max_runs=1), matrix, None, pattern, 1.0)
        found = system.solve(right_side, transposed=transposed)
        expected = np.linalg.solve(dense.T if transposed else dense, right_side)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


@NEEDS_NUMBA
@pytest.mark.parametrize("quick_iterations", [300, 1])
def test_single_precision_is_refined_and_plain_sweeps_follow_where_it_fails(
    monkeypatch, quick_iterations
):
    model = landscape_problem(60, 0.99).problem.mdp.transitions
    policy = np.full(model.available.shape, 1.0 / model.n_actions)
    transitions, right_side = transitions_of(model, DYNAMICS), np.ones(model.n_states)
    right_side[::7] = -3.0
    monkeypatch.setattr(swept_bicgstab, "QUICK_ITERATIONS", quick_iterations)
    plain = Engine(model).pattern
    matrix = plain.matrix(plain.system_data(policy, transitions.entries, 0.99))
    solver = Swept(Krylov(), SparseLu(), 0)
    monkeypatch.setattr(swept_bicgstab, "MOST_CROSSING", 0.1)
    system = engine_for(model, compiled_from=1).system(transitions, policy, 0.99, solver)
    for transposed in (False, True):
        found = system.solve(right_side, transposed=transposed)
        left = right_side - (matrix.T if transposed else matrix) @ found
        assert np.linalg.norm(left) <= 1e-11 * np.linalg.norm(right_side)
    failed = quick_iterations == 1
    expected = replace(solver, quick_from=model.n_states + 1) if failed else solver
    assert system.solver_of_next(solver) == expected


@NEEDS_NUMBA
def test_the_fallback_follows_where_sweeps_fail_and_is_kept():
    model = landscape_problem(12, 0.9999).problem.mdp.transitions
    policy = np.full(model.available.shape, 1.0 / model.n_actions)
    transitions, weak = transitions_of(model, DYNAMICS), Krylov(max_iterations=1, max_runs=1)
    solver, right_side = Swept(weak, SparseLu()), np.arange(float(model.n_states))
    fast = engine_for(model, compiled_from=1).system(transitions, policy, 0.9999, solver)
    exact = Engine(model).system(transitions, policy, 0.9999, SparseLu())
    np.testing.assert_allclose(fast.solve(right_side), exact.solve(right_side), rtol=1e-10)
    assert fast.solver_of_next(solver) == SparseLu()


@NEEDS_NUMBA
@pytest.mark.parametrize("graph", ["grid", "random graph"])
def test_graphs_that_are_not_local_start_with_plain_sweeps(graph):
    model, size = landscape_problem(100, 0.9).problem.mdp.transitions, 10_000
    if graph == "random graph":
        anywhere = np.random.default_rng(0).integers(size, size=model.successors.shape)
        model = replace(model, successors=anywhere)
    pattern = engine_for(model, compiled_from=1).pattern
    system = Swept(Krylov(), SparseLu(), 0).prepare(pattern, np.ones(len(pattern.column)))
    assert isinstance(system, WithFallback)
    assert isinstance(system.first, SweptSystem)
    assert system.fallback == (
        Swept(Krylov(), SparseLu(), size + 1) if graph == "grid" else SparseLu()
    )


@NEEDS_NUMBA
@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_sweeps_shrink_the_largest_error_and_values_that_rise_stay_below_the_solution(
    random_problem, seed
):
    problem, table = random_problem(seed, 0.95)
    mdp, rng = compiled(problem).mdp, np.random.default_rng(seed)
    rewards = rng.normal(size=mdp.available.shape)
    posed = BellmanProblem(SoftBellman(), rewards, transitions_of(mdp.transitions, table), mdp)
    exact = ValueIteration().solve(posed).value
    far = exact + 10.0 * rng.normal(size=mdp.n_states)
    for smallest in (np.inf, 0.0):
        error = np.max(np.abs(posed.engine.settled(posed, far, smallest) - exact))
        assert error <= 0.95 * np.max(np.abs(far - exact)) + 1e-8
    low = np.full(mdp.n_states, exact.min() - 5.0 / (1.0 - 0.95))
    assert np.all(backup(posed, low).gap > 0)
    swept = posed.engine.settled(posed, low, 1e-3)
    assert np.all(swept >= backup(posed, low).target - 1e-9)
    assert np.all(swept <= exact + 1e-8)
    np.testing.assert_allclose(posed.engine.settled(posed, exact, 1e-6), exact, atol=1e-8)


@NEEDS_NUMBA
def test_a_gradient_and_a_hessian_are_those_of_scipy_in_fewer_newton_steps():
    world = landscape_problem(60, 0.99)
    decisions, found = demonstrations(world, 5, 30), []
    for problem in (world.problem, compiled(world.problem)):
        posterior = objective_of(problem, decisions)
        start = starting_parameters(problem, posterior.policy_model, WEIGHTS, DYNAMICS)
        value = posterior.evaluate(start)
        found.append((value, posterior_hessian(posterior, start, value)))
    (plain, plain_hessian), (fast, fast_hessian) = found
    difference = np.max(np.abs(fast.solution.value - plain.solution.value))
    assert difference <= fast.solution.error_bound + plain.solution.error_bound
    assert fast.objective == pytest.approx(plain.objective, rel=1e-10)
    for one, other in (
        (fast.gradient.vector, plain.gradient.vector),
        (fast_hessian, plain_hessian),
    ):
        np.testing.assert_allclose(one, other, atol=1e-10 * np.max(np.abs(other)))
    assert fast.solution.linear_solves < 0.8 * plain.solution.linear_solves


@NEEDS_NUMBA
def test_a_given_solver_is_used_as_it_is():
    problem = landscape_problem(20, 0.9).problem
    mdp = compiled(problem).mdp
    transitions = transitions_of(mdp.transitions, DYNAMICS)
    rewards = reward_table(problem, WEIGHTS)
    for equation in (SoftBellman(), HardBellman()):
        posed = BellmanProblem(equation, rewards, transitions, mdp)
        exact = Newton(linear_solver=SparseLu()).solve(posed)
        plain = Newton().solve(replace(posed, mdp=problem.mdp))
        np.testing.assert_allclose(exact.value, plain.value, rtol=1e-10)


@NEEDS_NUMBA
@pytest.mark.usefixtures("untried")
def test_the_engine_is_compiled_from_the_limit_on(make_gridworld):
    model = make_gridworld(n_episodes=1).problem.mdp.transitions
    assert type(engine_for(model)) is Engine
    assert type(engine_for(model, model.n_states + 1)) is Engine
    assert isinstance(engine_for(model, model.n_states), CompiledEngine)
    assert choice.is_large(COMPILED_FROM)
    assert not choice.is_large(COMPILED_FROM - 1)
    assert not choice.is_large(2**31)


def test_without_numba_scipy_is_used_and_nothing_is_said(monkeypatch, make_gridworld):
    model = make_gridworld(n_episodes=1).problem.mdp.transitions
    monkeypatch.setattr(choice, "find_spec", lambda _: None)
    assert type(engine_for(model, 1)) is Engine


@pytest.mark.usefixtures("untried")
def test_a_numba_that_does_not_load_gives_one_warning_and_scipy(monkeypatch, make_gridworld):
    model = make_gridworld(n_episodes=1).problem.mdp.transitions
    monkeypatch.setattr(choice, "find_spec", lambda name: name)
    monkeypatch.setitem(sys.modules, "serd_core.bellman.compiled.compiled_engine", None)
    with pytest.warns(RuntimeWarning, match="compiled code is not used, .*: ModuleNotFoundError: "):
        assert type(engine_for(model, 1)) is Engine
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert type(engine_for(model, 1)) is Engine


@NEEDS_NUMBA
@pytest.mark.usefixtures("untried")
@pytest.mark.parametrize("wrong", ["raises", "gives other numbers"])
def test_compiled_code_that_fails_its_trial_is_not_used(monkeypatch, make_gridworld, wrong):
    def fails(*given_):
        if wrong == "raises":
            raise TypeError("no implementation\nof this function")
        given_[-1][:] = 0.0

    monkeypatch.setattr(compiled_engine, "_add_flow", fails)
    reason = "TypeError: no implementation" if wrong == "raises" else "must give the numbers"
    model = make_gridworld(n_episodes=1).problem.mdp.transitions
    with pytest.warns(RuntimeWarning, match=reason):
        assert type(engine_for(model, 1)) is Engine


NO_CACHE = """
import warnings
import numpy as np
from numba.core import caching
from serd_core.bellman.engine import Engine, engine_for
from serd_core.dynamics.sparse_model import fixed_transitions
caching.CompileResultCacheImpl._locator_classes = []  # as where no folder can be written to
state = np.zeros(1, int)
model = fixed_transitions((1, 1), state, state, state, np.ones(1))
with warnings.catch_warnings(record=True) as given:
    warnings.simplefilter("always")
    engines = [engine_for(model, 1) for _ in range(2)]
assert all(type(each) is Engine for each in engines), engines
assert ["no locator available" in str(each.message) for each in given] == [True], given
"""


@NEEDS_NUMBA
def test_without_a_folder_for_compiled_code_scipy_is_used():
    ended = subprocess.run(
        [sys.executable, "-c", NO_CACHE], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
