from functools import partial

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st

import serd_core as sc
from serd_core.demonstrations.observations import observe
from serd_core.dynamics import estimation
from serd_core.dynamics.estimation import OutcomeCounts, maximum_of, most_likely_dynamics
from support.refusals import refusals
from support.small_problems import apart, minimum_example_problem, room, sampled


def decisions_of(rows):
    return apart(*np.array(rows, dtype=int).reshape(-1, 3).T)


def test_an_unobserved_action_keeps_the_uniform_prior(minimum_example):
    """The Dirichlet mean: one pseudo-observation of each outcome, or another number."""
    estimate = sc.estimate_dynamics(minimum_example, decisions_of([(0, 0, 1)]))
    np.testing.assert_allclose(estimate, [[1 / 3, 2 / 3], [0.5, 0.5]])
    seen = observe(minimum_example, decisions_of([(0, 0, 1)] * 2 + [(0, 0, 0), (0, 1, 1)]))
    found = most_likely_dynamics(minimum_example.mdp.transitions, seen, 0.5)
    np.testing.assert_allclose(found.probabilities, [[1.5 / 4, 2.5 / 4], [0.5 / 2, 1.5 / 2]])
    assert (found.converged, found.steps) == (True, 1)
    assert found.error_bound < 1e-9


TRUTH = np.array([[0.1, 0.6, 0.1, 0.05, 0.15], [0.3, 0.3, 0.1, 0.2, 0.1]] * 2)
TRUTH[2:] = [0.1, 0.5, 0.2, 0.1, 0.1], [0.7, 0.2, 0.05, 0.02, 0.03]


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000))
def test_the_estimate_is_a_stationary_point_of_its_objective(seed):
    """In a corridor one cell wide, where sideways outcomes look like staying."""
    problem = room(12, 1, 11)
    policy = problem.mdp.available / problem.mdp.available.sum(axis=1, keepdims=True)
    decisions = sampled(problem, policy, TRUTH, 3, 30, seed, np.eye(12)[0])
    seen, model = observe(problem, decisions), problem.outcome_models
    found = most_likely_dynamics(model, seen, pseudo_count=0.5)
    assert found.converged

    def objective(theta):
        table = model.local_probabilities(theta)
        return seen.group_count @ np.log(seen.probabilities(table)) + 0.5 * np.log(table).sum()

    theta = model.parameters_of(found.probabilities)
    slopes = [
        (objective(theta + 1e-5 * unit) - objective(theta - 1e-5 * unit)) / 2e-5
        for unit in np.eye(len(theta))
    ]
    np.testing.assert_allclose(slopes, 0, atol=1e-5)


def wall_heavy_problem():
    """One model of three outcomes: state 0 hides 0 from 1, state 1 hides 1 from 2."""
    model = sc.OutcomeModels(
        np.array([[[0, 0, 1]], [[0, 1, 1]]]), np.zeros((2, 1), int), np.ones((2, 1), bool), 1
    )
    return sc.TabularProblem(sc.Mdp(model, 0.9), np.zeros((2, 1, 1)), ("nothing",))


def wall_heavy_decisions():
    """100,000 decisions that do not distinguish two outcomes, and three that do."""
    half = np.repeat([0, 1], 50_000)
    return apart(np.append(0 * half, [1, 1, 1]), 0, np.append(half, [0, 1, 1]))


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
    observations = observe(problem, wall_heavy_decisions())
    found = most_likely_dynamics(problem.mdp.transitions, observations, pseudo_count)
    assert found.converged
    assert found.steps < 20
    np.testing.assert_allclose(found.probabilities[0], exact, rtol=1e-9)
    assert np.all(np.abs(found.probabilities[0] - exact) <= found.error_bound * exact)


def test_an_estimate_that_cannot_be_certified_is_refused_with_a_way_out(monkeypatch):
    """Only the wall is observed, so that nothing but 1e-300 decides between what it hides."""
    problem, decisions = wall_heavy_problem(), wall_heavy_decisions()
    only_wall, model = decisions.select(np.arange(100_000)), problem.mdp.transitions
    found = most_likely_dynamics(model, observe(problem, only_wall), 1e-300)
    assert (found.steps, found.error_bound, found.converged) == (0, np.inf, False)
    with pytest.raises(sc.SerdError, match="may be off by a share of inf; pass dynamics"):
        sc.estimate_dynamics(problem, only_wall, pseudo_count=1e-300)
    short = partial(most_likely_dynamics, max_steps=1)
    found = short(model, observe(problem, decisions))
    assert (found.steps, found.converged) == (1, False)
    monkeypatch.setattr(estimation, "most_likely_dynamics", short)
    for fewer, more in ((0.5, "10.0"), (4.0, "40.0")):
        with pytest.raises(
            sc.SerdError, match=rf"_dynamics\(problem, decisions, pseudo_count={more}"
        ):
            sc.estimate_dynamics(problem, decisions, fewer)


KNOWN = sc.from_transitions(np.full((2, 1, 2), 0.5), np.ones((2, 1)), discount=0.9)


def estimated(*rows, pseudo_count=1.0):
    problem = minimum_example_problem(0.9)
    return lambda: sc.estimate_dynamics(problem, decisions_of(rows), pseudo_count)


test_decisions_that_the_problem_rules_out_are_named_and_known_transitions_need_none = refusals(
    (estimated((0, 0, 1), (1, 2, 0)), r"decisions\[1\] reaches state 0 from state 1 by action 2"),
    (estimated((1, 0, 1)), r"decisions\[0\] takes action 0 in state 1, where it is not available"),
    (estimated((0, 0, 5)), r"decisions\[0\] reaches state 5 from state 0"),
    (estimated((7, 0, 0)), r"state\[0\] must be below 2, got 7"),
    (estimated(), "decisions must hold at least one decision"),
    (estimated((0, 0, 1), pseudo_count=np.array([1.0, 2.0])), "pseudo_count must be finite and ab"),
    (lambda: sc.estimate_dynamics(KNOWN, apart(0, 0, [1])), "must be OutcomeModels here, got Sp"),
    (lambda: sc.fit_mdce_serd(KNOWN, apart(0, 0, [1]), dynamics=[0.5]), "must be None"),
)


#: Three outcomes, seen 30 times as 0 or 1, 12 times as 1 or 2, twice as 0 and 5 times as 2.
SETS = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
COUNTS = np.array([30.0, 12.0, 2.0, 5.0])


@pytest.mark.parametrize("start", [(1e-9, 1e-9), (1e-9, 0.5), (0.5, 1e-9), (0.999, 5e-4)])
def test_newtons_method_reaches_the_maximum_from_far_away_without_a_loss(start):
    counts = OutcomeCounts(SETS, COUNTS, np.full(SETS.shape[1], 0.25))
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
