"""Compiled code against its plain twins in NumPy and SciPy."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lab.benchmarks.learning import solvers
from lab.benchmarks.learning.gridworld_problems import (
    DYNAMICS,
    WEIGHTS,
    demonstrations,
    landscape_problem,
    objective_of,
)
from serd_core import compiled
from serd_core.bellman import newton
from serd_core.bellman.backup import BellmanProblem, backup
from serd_core.bellman.equations import SoftBellman
from serd_core.bellman.linear import krylov
from serd_core.bellman.linear import policy_pattern as linear_pattern
from serd_core.bellman.linear.automatic import Automatic
from serd_core.bellman.linear.krylov import Krylov, Swept, SweptSystem
from serd_core.bellman.linear.linear_solver import WithFallback
from serd_core.bellman.linear.policy_pattern import EntryPattern, policy_pattern
from serd_core.bellman.value_iteration import ValueIteration
from serd_core.compiled import HAS_NUMBA
from serd_core.dynamics.transition_model import Sweeps, transitions_of
from serd_core.learners.start import starting_parameters
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem, usable_features, weights_gradient
from serd_core.mdp.problem import rewards as reward_table
from serd_core.policies.solved_policy import soft_policy

pytestmark = pytest.mark.skipif(not HAS_NUMBA, reason="numba (the extra `fast`) is not installed")


@pytest.fixture(scope="module")
def everything_compiled():
    """Problems of any size use compiled code."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiled, "SMALLEST_COMPILED", 0)
        yield


def random_policy(mdp, rng):
    policy = rng.random(mdp.available.shape) * mdp.available
    return policy / policy.sum(axis=1, keepdims=True)


@pytest.mark.usefixtures("everything_compiled")
@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_sums_over_the_entries_are_those_of_the_matrix(random_problem, seed):
    problem, table = random_problem(seed, 0.95)
    mdp, rng = problem.mdp, np.random.default_rng(seed)
    transitions, model = transitions_of(mdp.transitions, table), mdp.transitions
    assert model.compiled_rows is not None
    values, weights = rng.normal(size=mdp.n_states), rng.normal(size=mdp.available.shape)
    rewards = np.where(mdp.available, weights, -np.inf)
    np.testing.assert_allclose(
        transitions.backed_up(rewards, 0.95, values),
        rewards + 0.95 * transitions.expected(values),
        atol=1e-13,
    )
    np.testing.assert_allclose(
        transitions.flow(weights), transitions.matrix.T @ weights.ravel(), atol=1e-13
    )
    policy, pattern = random_policy(mdp, rng), mdp.policy_pattern
    plain = policy_pattern(model.row, model.successor, mdp.n_states, mdp.n_actions)
    assert not isinstance(pattern, EntryPattern)
    np.testing.assert_array_equal(pattern.column, plain.column)
    np.testing.assert_allclose(
        transitions.system_data(pattern, policy, 0.95),
        plain.system_data(policy, transitions.entries, 0.95),
        atol=1e-14,
    )
    by_entry = weights.ravel()[model.row] * values[model.successor]
    np.testing.assert_allclose(
        transitions.local_gradient(weights, values, 0.95),
        0.95 * model.gather(by_entry),
        atol=1e-12,
    )


@pytest.mark.usefixtures("everything_compiled")
@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_the_fused_maximum_is_that_of_the_table(random_problem, seed):
    problem, table = random_problem(seed, 0.95)
    mdp, rng = problem.mdp, np.random.default_rng(seed)
    transitions = transitions_of(mdp.transitions, table)
    rewards = np.where(mdp.available, rng.normal(size=mdp.available.shape), -np.inf)
    values = 10.0 * rng.normal(size=mdp.n_states)
    expected = np.logaddexp.reduce(rewards + 0.95 * transitions.expected(values), axis=1)
    np.testing.assert_allclose(
        mdp.transitions.compiled_rows.soft_maximum((transitions.flat, rewards, 0.95), values),
        expected,
        rtol=1e-13,
        atol=1e-13,
    )


@pytest.mark.usefixtures("everything_compiled")
def test_tables_that_repeat_along_the_actions_are_kept_once_and_change_nothing():
    problem = landscape_problem(7, 0.9).problem
    mdp, features = problem.mdp, problem.features
    model = mdp.transitions
    assert model.successors.strides[1] == features.strides[1] == 0
    full = TabularProblem(
        Mdp(replace(model, successors=model.successors.copy()), mdp.discount),
        features.copy(),
        problem.feature_names,
    )
    assert full.mdp.transitions.successors.strides[1] > 0
    assert full.features.strides[1] > 0
    once, each = (soft_policy(given, WEIGHTS, DYNAMICS) for given in (problem, full))
    np.testing.assert_allclose(once.value, each.value, atol=once.error_bound + each.error_bound)
    by_reward = np.random.default_rng(0).normal(size=mdp.available.shape)
    np.testing.assert_allclose(
        weights_gradient(features, by_reward), weights_gradient(full.features, by_reward)
    )
    np.testing.assert_array_equal(usable_features(full)[::5], usable_features(problem))


@pytest.mark.usefixtures("everything_compiled")
@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000), size=st.sampled_from([1e-3, 1.0, 1e4]))
def test_soft_maximum_and_policy_are_those_of_numpy(seed, size):
    rng = np.random.default_rng(seed)
    q = size * rng.normal(size=(7, 4))
    q[rng.random(q.shape) < 0.3] = -np.inf
    q[:, 0] = rng.normal(size=7)
    expected = np.logaddexp.reduce(q, axis=1)
    np.testing.assert_allclose(SoftBellman().maximum(q), expected, rtol=1e-14, atol=1e-14)
    weights = np.exp(q - expected[:, None])
    np.testing.assert_allclose(SoftBellman().policy(q), weights, rtol=1e-10, atol=1e-300)


@pytest.mark.usefixtures("everything_compiled")
@settings(deadline=None, max_examples=20)
@given(
    seed=st.integers(0, 10_000),
    discount=st.sampled_from([0.95, 0.999, 0.9995]),
    quick_from=st.sampled_from([0, krylov.QUICK_FROM]),
    split_from=st.sampled_from([0, compiled.SMALLEST_SPLIT]),
)
def test_swept_solutions_are_those_of_the_dense_solver(
    random_problem, seed, discount, quick_from, split_from
):
    problem, table = random_problem(seed, discount)
    mdp, rng = problem.mdp, np.random.default_rng(seed)
    policy, transitions = random_policy(mdp, rng), transitions_of(mdp.transitions, table)
    data = transitions.system_data(mdp.policy_pattern, policy, discount)
    dense, right_side = mdp.policy_pattern.matrix(data).toarray(), rng.normal(size=mdp.n_states)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(krylov, "QUICK_FROM", quick_from)
        patch.setattr(compiled, "SMALLEST_SPLIT", split_from)
        patch.setattr(linear_pattern, "_MOST_CROSSING", 1.0)
        patch.setattr(linear_pattern, "_WIDEST_SEAM", 1.0)
        system = Krylov().prepare(mdp.policy_pattern, data)
    assert isinstance(system, WithFallback if quick_from == 0 else SweptSystem)
    atol = 1e-9 / (1.0 - discount)
    np.testing.assert_allclose(
        system.solve(right_side), np.linalg.solve(dense, right_side), atol=atol
    )
    np.testing.assert_allclose(
        system.solve(right_side, transposed=True), np.linalg.solve(dense.T, right_side), atol=atol
    )


@pytest.mark.parametrize("n_states", [2, 3, 8, 41])
@pytest.mark.parametrize("split_from", [0, compiled.SMALLEST_SPLIT])
def test_the_factor_of_a_chain_is_exact_in_twisted_order(monkeypatch, n_states, split_from):
    from serd_core.bellman.linear.swept_bicgstab import SweptMatrix

    monkeypatch.setattr(compiled, "SMALLEST_SPLIT", split_from)
    monkeypatch.setattr(linear_pattern, "_MOST_CROSSING", 1.0)
    monkeypatch.setattr(linear_pattern, "_WIDEST_SEAM", 1.0)
    rng, own = np.random.default_rng(n_states), np.arange(n_states)
    row = np.repeat(own, 3)
    successor = np.clip(own[:, None] + np.array([-1, 0, 1]), 0, n_states - 1).ravel()
    pattern = policy_pattern(row, successor, n_states, 1)
    assert len(pattern.seam.sides) == (2 if split_from == 0 and n_states > 2 else 1)
    entries = rng.dirichlet(np.ones(3), size=n_states).ravel()
    data = pattern.system_data(np.ones((n_states, 1)), entries, 0.99)
    right_side = rng.normal(size=n_states)
    for transposed in (False, True):
        found = SweptMatrix(pattern, data, 1.0).solve(right_side, transposed, 0.0, 1)
        dense = pattern.matrix(data).toarray()
        expected = np.linalg.solve(dense.T if transposed else dense, right_side)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_two_threads_and_one_give_the_same_bits(monkeypatch):
    monkeypatch.setattr(compiled, "SMALLEST_SPLIT", 20_000)
    monkeypatch.setattr(krylov, "QUICK_FROM", 0)
    values = []
    for cores in (1, 2):
        monkeypatch.setattr(compiled.os, "cpu_count", lambda cores=cores: cores)
        found = large_gradient(monkeypatch, has_numba=True)
        values.append((found.solution.value, found.gradient.vector))
    np.testing.assert_array_equal(values[0][0], values[1][0])
    np.testing.assert_array_equal(values[0][1], values[1][1])


def test_a_large_system_is_solved_to_the_residual_asked_for():
    mdp = landscape_problem(145, 0.99).problem.mdp
    policy = np.full(mdp.available.shape, 1.0 / mdp.n_actions)
    pattern = mdp.policy_pattern
    data = transitions_of(mdp.transitions, DYNAMICS).system_data(pattern, policy, mdp.discount)
    right_side = np.random.default_rng(0).normal(size=mdp.n_states)
    system = Automatic(largest_lu_states=0).prepare(pattern, data)
    assert isinstance(system, SweptSystem)
    for transposed in (False, True):
        found = system.solve(right_side, transposed=transposed)
        matrix = pattern.matrix(data)
        left = right_side - (matrix.T if transposed else matrix) @ found
        assert np.linalg.norm(left) <= 1e-11 * np.linalg.norm(right_side)


@pytest.mark.parametrize("quick_iterations", [krylov.QUICK_ITERATIONS, 1])
def test_single_precision_is_refined_and_sweeps_follow_where_it_fails(
    monkeypatch, quick_iterations
):
    mdp = landscape_problem(145, 0.99).problem.mdp
    policy = np.full(mdp.available.shape, 1.0 / mdp.n_actions)
    pattern = mdp.policy_pattern
    data = transitions_of(mdp.transitions, DYNAMICS).system_data(pattern, policy, mdp.discount)
    right_side = np.random.default_rng(0).normal(size=mdp.n_states)
    monkeypatch.setattr(krylov, "QUICK_FROM", 0)
    monkeypatch.setattr(krylov, "QUICK_ITERATIONS", quick_iterations)
    system, solver = Krylov().prepare(pattern, data), Krylov()
    assert system.solver_of_next(solver) is solver
    for transposed in (False, True):
        found = system.solve(right_side, transposed=transposed)
        matrix = pattern.matrix(data)
        left = right_side - (matrix.T if transposed else matrix) @ found
        assert np.linalg.norm(left) <= 1e-11 * np.linalg.norm(right_side)
    failed = quick_iterations == 1
    assert system.solver_of_next(solver) == (Swept(solver) if failed else solver)


@pytest.mark.usefixtures("everything_compiled")
@pytest.mark.parametrize("graph", ["grid", "random graph"])
def test_graphs_that_are_not_local_start_with_sweeps(monkeypatch, graph):
    monkeypatch.setattr(krylov, "QUICK_FROM", 0)
    mdp = solvers.case_of(solvers.GRAPHS[graph](10_000), 0.9).problem.mdp
    system = Krylov().prepare(mdp.policy_pattern, np.ones(len(mdp.policy_pattern.column)))
    assert isinstance(system, WithFallback if graph == "grid" else SweptSystem)


def large_gradient(monkeypatch, has_numba):
    monkeypatch.setattr(compiled, "HAS_NUMBA", has_numba)
    world = landscape_problem(145, 0.99)
    posterior = objective_of(world.problem, demonstrations(world, 20, 30))
    assert (world.problem.mdp.transitions.compiled_rows is not None) == has_numba
    start = starting_parameters(world.problem, posterior.policy_model, WEIGHTS, DYNAMICS)
    return posterior.evaluate(start)


def test_a_numba_that_does_not_load_is_not_used(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    compiled.numba_loads.cache_clear()
    assert not compiled.is_compiled(compiled.SMALLEST_COMPILED)
    monkeypatch.undo()
    compiled.numba_loads.cache_clear()
    assert compiled.is_compiled(compiled.SMALLEST_COMPILED)


def test_a_large_gradient_is_the_same_with_and_without_numba(monkeypatch):
    fast, plain = (large_gradient(monkeypatch, has_numba) for has_numba in (True, False))
    difference = np.max(np.abs(fast.solution.value - plain.solution.value))
    assert difference <= fast.solution.error_bound + plain.solution.error_bound
    assert fast.objective == pytest.approx(plain.objective, rel=1e-12)
    size = np.max(np.abs(plain.gradient.vector))
    np.testing.assert_allclose(fast.gradient.vector, plain.gradient.vector, atol=1e-9 * size)


@pytest.mark.usefixtures("everything_compiled")
@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_soft_systems_are_those_of_the_soft_policy(random_problem, seed):
    problem, table = random_problem(seed, 0.95)
    mdp, rng = problem.mdp, np.random.default_rng(seed)
    transitions, pattern = transitions_of(mdp.transitions, table), mdp.policy_pattern
    rewards = np.where(mdp.available, rng.normal(size=mdp.available.shape), -np.inf)
    values = 10.0 * rng.normal(size=mdp.n_states)
    policy = SoftBellman().policy(transitions.backed_up(rewards, 0.95, values))
    np.testing.assert_allclose(
        mdp.transitions.compiled_rows.soft_system_data(
            pattern, (transitions.flat, rewards, 0.95), values
        ),
        transitions.system_data(pattern, policy, 0.95),
        atol=1e-13,
    )


@pytest.mark.usefixtures("everything_compiled")
@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_sweeps_shrink_the_largest_error_and_values_that_rise_stay_below_the_solution(
    random_problem, seed
):
    problem, table = random_problem(seed, 0.95)
    mdp, rng = problem.mdp, np.random.default_rng(seed)
    rewards = rng.normal(size=mdp.available.shape)
    posed = BellmanProblem(SoftBellman(), rewards, transitions_of(mdp.transitions, table), mdp)
    exact = ValueIteration().solve(posed).value
    far = exact + 10.0 * rng.normal(size=mdp.n_states)

    def settled(values, sweeps):
        return posed.fused.settle(posed.given, values, sweeps)

    error = np.max(np.abs(settled(far, Sweeps(3, 3, 0.0)) - exact))
    assert error <= 0.95**3 * np.max(np.abs(far - exact)) + 1e-8
    low = np.full(mdp.n_states, exact.min() - 5.0 / (1.0 - 0.95))
    assert np.all(backup(posed, low).gap > 0)
    swept = settled(low, Sweeps(2, 40, 1e-3))
    assert np.all(swept >= backup(posed, backup(posed, low).target).target - 1e-9)
    assert np.all(swept <= exact + 1e-8)
    np.testing.assert_allclose(settled(exact, Sweeps(1, 40, 1e-6)), exact, atol=1e-8)


@pytest.mark.usefixtures("everything_compiled")
def test_swept_newton_steps_reach_the_solution_in_fewer_steps(monkeypatch):
    problem = landscape_problem(40, 0.99).problem
    transitions = transitions_of(problem.mdp.transitions, DYNAMICS)
    posed = BellmanProblem(SoftBellman(), reward_table(problem, WEIGHTS), transitions, problem.mdp)
    plain = newton.Newton().solve(posed)
    monkeypatch.setattr(newton, "SWEPT_FROM", 0)
    swept = newton.Newton().solve(posed)
    np.testing.assert_allclose(swept.value, plain.value, atol=swept.error_bound + plain.error_bound)
    assert swept.linear_solves < 0.8 * plain.linear_solves
