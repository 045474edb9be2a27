from functools import partial

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st

import serd_core as sc
from serd_core.arrays import floored
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import observe
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics import estimation
from serd_core.dynamics.estimation import (
    OutcomeCounts,
    estimate_dynamics,
    maximum_of,
    most_likely_dynamics,
    outcome_models_of,
)
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import build_navigation_problem
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem


def decisions_of(rows):
    state, action, following = np.array(rows, dtype=int).reshape(-1, 3).T
    zeros = np.zeros(len(state), dtype=int)
    return Decisions(zeros, np.arange(len(state), dtype=float), state, action, following)


def test_an_unobserved_action_keeps_the_uniform_prior(minimum_example):
    estimate = estimate_dynamics(minimum_example, decisions_of([(0, 0, 1)]))
    np.testing.assert_allclose(estimate[1], [0.5, 0.5])
    # The Dirichlet mean: one pseudo-observation of each outcome, unless another number is given.
    np.testing.assert_allclose(estimate[0], [1 / 3, 2 / 3])


def test_counts_that_no_wall_hides_are_shared_to_the_estimate_before_newtons_method(
    minimum_example,
):
    decisions = decisions_of([(0, 0, 1)] * 2 + [(0, 0, 0)] + [(0, 1, 1)] * 5)
    observations = observe(minimum_example.mdp, decisions)
    found = most_likely_dynamics(minimum_example.mdp.transitions, observations, 0.5)
    np.testing.assert_allclose(found.probabilities, [[1.5 / 4, 2.5 / 4], [0.5 / 6, 5.5 / 6]])
    assert found.converged
    assert found.steps == 1
    assert found.error_bound < 1e-9


def walled_problem():
    """A corridor one cell wide: moves along it are clear, sideways outcomes look like staying."""
    grid = Grid(origin_m=(0, 0), cell_size_m=1.0, walkable=np.ones((12, 1), bool))
    return build_navigation_problem(
        grid=grid,
        flow=np.full(12, Action.NORTH),
        goal_states=[11],
        wall_distance_m=np.ones(12),
        discount=0.9,
    )


def room_problem():
    grid = Grid(origin_m=(0, 0), cell_size_m=1.0, walkable=np.ones((6, 6), bool))
    return build_navigation_problem(
        grid=grid,
        flow=np.full(36, Action.NORTH),
        goal_states=[35],
        wall_distance_m=np.ones(36),
        discount=0.9,
    )


TRUTH = np.array(
    [
        [0.1, 0.6, 0.1, 0.05, 0.15],
        [0.3, 0.3, 0.1, 0.2, 0.1],
        [0.1, 0.5, 0.2, 0.1, 0.1],
        [0.7, 0.2, 0.05, 0.02, 0.03],
    ]
)


def test_estimates_are_unbiased_although_walls_hide_outcomes():
    problem = room_problem()
    policy = problem.mdp.available / problem.mdp.available.sum(axis=1, keepdims=True)
    decisions = sample_decisions(
        problem.mdp,
        policy,
        TRUTH,
        np.eye(36)[0],
        n_episodes=400,
        n_steps=200,
        rng=np.random.default_rng(3),
    )
    estimate = estimate_dynamics(problem, decisions)
    np.testing.assert_allclose(estimate, TRUTH, atol=0.02)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000))
def test_the_estimate_is_a_stationary_point_of_its_objective(seed):
    problem = walled_problem()
    rng = np.random.default_rng(seed)
    policy = problem.mdp.available / problem.mdp.available.sum(axis=1, keepdims=True)
    decisions = sample_decisions(
        problem.mdp, policy, TRUTH, np.eye(12)[0], n_episodes=3, n_steps=30, rng=rng
    )
    observations, model = observe(problem.mdp, decisions), problem.outcome_models
    found = most_likely_dynamics(model, observations, pseudo_count=0.5)
    assert found.converged

    def objective(theta):
        table = model.local_probabilities(theta)
        observed = np.bincount(
            observations.entry_group, weights=table.ravel()[observations.local_index]
        )
        return observations.group_count @ np.log(floored(observed)) + 0.5 * np.log(table).sum()

    theta = model.parameters_of(found.probabilities)
    slopes = [
        (objective(theta + 1e-5 * unit) - objective(theta - 1e-5 * unit)) / 2e-5
        for unit in np.eye(len(theta))
    ]
    np.testing.assert_allclose(slopes, 0, atol=1e-5)


def wall_heavy_problem():
    """One model of three outcomes: state 0 hides 0 from 1, state 1 hides 1 from 2."""
    model = OutcomeModels(
        np.array([[[0, 0, 1]], [[0, 1, 1]]]), np.zeros((2, 1), int), np.ones((2, 1), bool), 1
    )
    return TabularProblem(Mdp(model, 0.9), np.zeros((2, 1, 1)), ("nothing",))


def wall_heavy_decisions():
    """100,000 decisions that do not distinguish two outcomes, and three that do."""
    half = np.repeat([0, 1], 50_000)
    state, following = np.append(0 * half, [1, 1, 1]), np.append(half, [0, 1, 1])
    zeros = np.zeros(len(state), dtype=int)
    return Decisions(zeros, np.arange(len(state), dtype=float), state, zeros, following)


@pytest.mark.parametrize("pseudo_count", [10.0, 1.0, 0.01, 1e-4])
def test_three_telling_decisions_among_a_hundred_thousand_are_heard(pseudo_count):
    """Against the root of the gradient; sharing alone was off by 0.014 after 10,000 steps."""

    def slopes(free):
        first, second = free
        third = 1.0 - first - second
        by_third = 50_000 / third + 2.0 / (second + third) + pseudo_count / third
        wall = 50_000 / (first + second)
        return [
            wall + 1.0 / first + pseudo_count / first - by_third,
            wall + 2.0 / (second + third) + pseudo_count / second - by_third,
        ]

    root = scipy.optimize.root(slopes, [0.3, 0.2], options={"xtol": 1e-14})
    exact = np.append(root.x, 1.0 - root.x.sum())
    problem = wall_heavy_problem()
    observations = observe(problem.mdp, wall_heavy_decisions())
    found = most_likely_dynamics(problem.mdp.transitions, observations, pseudo_count)
    assert found.converged
    assert found.steps < 20
    np.testing.assert_allclose(found.probabilities[0], exact, rtol=1e-9)
    assert np.all(np.abs(found.probabilities[0] - exact) <= found.error_bound * exact)


def test_a_pseudo_count_lost_in_the_counts_is_said():
    """Only the wall is observed, so that nothing but 1e-300 decides between what it hides."""
    problem, everything = wall_heavy_problem(), wall_heavy_decisions()
    seen = observe(problem.mdp, everything.select(np.arange(100_000)))
    found = most_likely_dynamics(problem.mdp.transitions, seen, 1e-300)
    assert (found.steps, found.error_bound, found.converged) == (0, np.inf, False)
    np.testing.assert_allclose(found.probabilities.sum(axis=1), 1.0)
    with pytest.raises(SerdError, match="may be off by a share of inf; pass dynamics"):
        estimate_dynamics(problem, everything.select(np.arange(100_000)), pseudo_count=1e-300)


def test_running_out_of_steps_is_said_with_a_way_out(monkeypatch):
    problem, decisions = wall_heavy_problem(), wall_heavy_decisions()
    short = partial(most_likely_dynamics, max_steps=1)
    found = short(problem.mdp.transitions, observe(problem.mdp, decisions))
    assert not found.converged
    assert found.steps == 1
    monkeypatch.setattr(estimation, "most_likely_dynamics", short)
    for fewer, more in ((0.5, "10.0"), (4.0, "40.0")):
        with pytest.raises(
            SerdError, match=rf"estimate_dynamics\(problem, decisions, pseudo_count={more}\)"
        ):
            estimate_dynamics(problem, decisions, fewer)


@pytest.mark.parametrize(
    ("rows", "sentence"),
    [
        ([(0, 0, 1), (1, 2, 0)], r"decisions\[1\] reaches state 0 from state 1 by action 2"),
        ([(1, 0, 1)], r"decisions\[0\] takes action 0 in state 1, where it is not available"),
        ([(0, 0, 5)], r"decisions\[0\] reaches state 5 from state 0"),
        ([(7, 0, 0)], r"state\[0\] must be below 2, got 7"),
        ([], "decisions must hold at least one decision"),
    ],
)
def test_decisions_that_the_problem_rules_out_are_named(minimum_example, rows, sentence):
    with pytest.raises(SerdError, match=sentence):
        estimate_dynamics(minimum_example, decisions_of(rows))


#: Three outcomes, seen 30 times as 0 or 1, 12 times as 1 or 2, twice as 0 and 5 times as 2.
SETS = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
COUNTS = np.array([30.0, 12.0, 2.0, 5.0])


@pytest.mark.parametrize("pseudo_count", [0.25, 4.0])
def test_a_newton_step_solves_the_equations_of_the_objective(pseudo_count):
    """Sums outcome by outcome, and differences of the objective along the step."""
    counts = OutcomeCounts(SETS, COUNTS, pseudo_count)
    probabilities = np.array([0.5, 0.2, 0.3])
    value = sum(
        n * np.log(probabilities[each > 0].sum()) for n, each in zip(COUNTS, SETS, strict=True)
    )
    value += pseudo_count * np.log(probabilities).sum()
    assert counts.objective(probabilities) == pytest.approx(value)
    curvature, wanted = pseudo_count * np.eye(3), np.full(3, pseudo_count)
    for n, each in zip(COUNTS, SETS, strict=True):
        share = each * probabilities / probabilities[each > 0].sum()
        curvature, wanted = curvature + n * np.outer(share, share), wanted + n * share
    move, size, slope = counts.newton(probabilities)
    assert probabilities @ move == pytest.approx(0.0, abs=1e-12)
    rest = (curvature @ move - wanted) / probabilities
    np.testing.assert_allclose(rest, rest[0])
    assert size == pytest.approx(move @ curvature @ move)
    assert slope == pytest.approx(size)
    along = [counts.objective(probabilities * (1.0 + t * move)) for t in (-1e-4, 0.0, 1e-4)]
    assert (along[2] - along[0]) / 2e-4 == pytest.approx(slope, rel=1e-5)
    assert (2.0 * along[1] - along[2] - along[0]) / 1e-8 == pytest.approx(size, rel=1e-4)


@pytest.mark.parametrize("pseudo_count", [0.25, 4.0])
def test_the_error_bound_is_that_of_the_decrement_where_it_is_below_a_third(pseudo_count):
    counts = OutcomeCounts(SETS, COUNTS, pseudo_count)
    exact = maximum_of(counts, np.full(3, 1 / 3), 1e-9, 100)
    assert exact.converged

    def away(length):
        return (
            exact.probabilities
            * (1.0 + length * np.array([1.0, -1.0, 0.0]))
            / (1.0 + length * (exact.probabilities[0] - exact.probabilities[1]))
        )

    def decrement(length):
        return np.sqrt(counts.newton(away(length))[1] / min(1.0, pseudo_count))

    for wanted, certified in ((0.1, True), (0.3, True), (0.36, False), (0.6, False)):
        length = scipy.optimize.brentq(lambda t, d=wanted: decrement(t) - d, 0.0, 0.9)
        early = maximum_of(counts, away(length), tolerance=10.0, max_steps=1)
        assert early.converged == certified
        assert early.steps == 1
        bound = wanted / (1.0 - wanted) if certified else np.inf
        assert early.error_bound == pytest.approx(bound)
        assert np.all(np.abs(early.probabilities - exact.probabilities) <= bound)


@pytest.mark.parametrize("start", [(1e-9, 1e-9), (1e-9, 0.5), (0.5, 1e-9), (0.999, 5e-4)])
def test_newtons_method_reaches_the_maximum_from_far_away_without_a_loss(start):
    counts = OutcomeCounts(SETS, COUNTS, 0.25)
    exact = maximum_of(counts, np.full(3, 1 / 3), 1e-9, 100).probabilities
    probabilities = np.array([*start, 1.0 - sum(start)])
    found = maximum_of(counts, probabilities, 1e-9, 100)
    assert found.converged
    np.testing.assert_allclose(found.probabilities, exact, rtol=1e-8)
    assert found.probabilities.sum() == pytest.approx(1.0, abs=1e-14)
    values = [
        counts.objective(maximum_of(counts, probabilities, 1e-9, n_steps).probabilities)
        for n_steps in range(1, found.steps)
    ]
    assert np.all(np.diff([counts.objective(probabilities), *values]) > -1e-9)


def test_outcome_models_are_asked_for_where_dynamics_have_none():
    table = np.array([[[0.5, 0.5]], [[0.5, 0.5]]])
    listed = sc.from_transitions(table, np.zeros((2, 1, 1)), discount=0.9, learned=True)
    with pytest.raises(SerdError, match=r"^dynamics must be OutcomeModels here, got SparseModel"):
        outcome_models_of(listed.mdp)
