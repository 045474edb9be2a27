"""Outcome models that depend on density: Table 5.1 as their special case, and their tables."""

from dataclasses import replace

import numpy as np
import pytest

from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.covariate_models import CovariateModels
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.density import (
    DENSITIES_PM2,
    DENSITY_MODEL_NAMES,
    at_decisions,
    crowd_shares,
    full_table,
    in_random_crowds,
    with_density,
)
from serd_core.grid.grid import Action, Grid, Outcome
from serd_core.grid.navigation import MODEL_NAMES, build_navigation_problem
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.mdp import Mdp
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior.parameters import Block
from serd_core.priors.dirichlet import DirichletPrior
from serd_core.priors.gaussian import GaussianPrior

GRID = Grid((0.0, 0.0), 1.0, np.ones((7, 4), dtype=np.bool_))
FLOW = np.where(GRID.cells[:, 1] < 2, int(Action.SOUTH), int(Action.NORTH))
PLAIN = build_navigation_problem(
    grid=GRID,
    flow=FLOW,
    goal_states=np.flatnonzero(GRID.cells[:, 0] == 6),
    wall_distance_m=0.5 + np.minimum(GRID.cells[:, 1], 3 - GRID.cells[:, 1]),
    discount=0.95,
)
WEIGHTS = np.array([3.0, 0.5, -0.5])
PRIOR = GaussianPrior(2.0, Block.REWARD) + DirichletPrior(1.0)


def truth_rows() -> np.ndarray:
    """(8, 5): outcomes without people and at 1 person/m2; density holds moves up."""
    free = np.full((4, 5), 0.02)
    free[:3, Outcome.FORWARD] = 0.92
    free[3, Outcome.STAY] = 0.92
    held = free.copy()
    held[:3] = 0.05
    held[:3, Outcome.FORWARD] = (0.6, 0.25, 0.4)
    held[:3, Outcome.STAY] = 0.85 - held[:3, Outcome.FORWARD]
    return np.concatenate([free, held])


def demonstrations(n_episodes: int = 60) -> Decisions:
    table = truth_rows()[:4]
    policy = soft_policy(PLAIN, WEIGHTS, table).probabilities
    starts = (GRID.cells[:, 0] == 0) / 4.0
    rng = np.random.default_rng(3)
    found = sample_decisions(
        PLAIN.mdp, policy, table, starts, n_episodes=n_episodes, n_steps=40, rng=rng
    )
    return found.select(~np.isin(found.state, PLAIN.goal_states))


def test_indicators_of_the_four_models_give_the_fit_and_the_estimate_of_table_5_1():
    old = PLAIN.outcome_models
    same = CovariateModels(
        old.successors, old.model_of, old.available, 4, intended=old.intended, covariates=np.eye(4)
    )
    problem = replace(PLAIN, outcome_models=same, mdp=Mdp(same, PLAIN.mdp.discount))
    seen = demonstrations()
    for decisions in (seen, seen.with_hidden_actions()):
        table, other = (
            fit_mdce_serd(each, decisions, prior=PRIOR, initial_weights=np.zeros(3))
            for each in (PLAIN, problem)
        )
        assert table.converged
        assert other.objective == pytest.approx(table.objective, abs=1e-6)
        np.testing.assert_allclose(other.reward_weights, table.reward_weights, atol=1e-3)
        np.testing.assert_allclose(
            other.outcome_probabilities, table.outcome_probabilities, atol=1e-4
        )
    np.testing.assert_allclose(
        estimate_dynamics(problem, seen), estimate_dynamics(PLAIN, seen), atol=1e-5
    )


def test_where_the_density_is_0_everywhere_table_5_1_is_learned():
    problem = with_density(PLAIN, np.zeros(GRID.n_states))
    seen = demonstrations()
    table, other = (
        fit_mdce_serd(each, seen, prior=PRIOR, initial_weights=np.zeros(3))
        for each in (PLAIN, problem)
    )
    assert other.converged
    np.testing.assert_allclose(other.reward_weights, table.reward_weights, atol=1e-3)
    np.testing.assert_allclose(
        other.outcome_probabilities[:4], table.outcome_probabilities, atol=1e-4
    )
    assert other.objective - table.objective == pytest.approx(-4 * 5 * np.log(5), abs=1e-4)


def test_decisions_in_the_usual_crowd_are_those_of_the_cells():
    density = 0.25 * (np.arange(GRID.n_states) % 5)
    problem, seen = with_density(PLAIN, density), demonstrations(20)
    own, decisions = at_decisions(problem, seen, density[GRID.neighbours[seen.state]])
    fits = [
        fit_mdce_serd(each, made, prior=PRIOR, initial_weights=np.zeros(3))
        for each, made in ((problem, seen), (own, decisions))
    ]
    assert fits[1].objective == pytest.approx(fits[0].objective, abs=1e-6)
    np.testing.assert_allclose(
        fits[1].outcome_probabilities, fits[0].outcome_probabilities, atol=1e-4
    )


def test_a_density_that_holds_moves_up_is_recovered_from_its_value_at_each_decision():
    rng, table = np.random.default_rng(1), full_table(truth_rows())
    cells = with_density(PLAIN, np.full(GRID.n_states, 0.5))
    free = np.flatnonzero(~np.isin(np.arange(GRID.n_states), PLAIN.goal_states))
    n = 6000
    state, action = rng.choice(free, n), rng.integers(1, 5, n)
    density = 0.25 * rng.integers(0, 7, (n, 5))
    blank = Decisions(np.arange(n), np.zeros(n), state, action, state)
    own, _ = at_decisions(cells, blank, density)
    models, states = own.outcome_models, GRID.n_states + np.arange(n)
    share = table[models.model_of[states, action]]
    outcome = (rng.random(n)[:, None] > share.cumsum(axis=1)).sum(axis=1).clip(0, 4)
    made = replace(blank, next_state=models.successors[states, action, outcome])
    problem, decisions = at_decisions(cells, made, density)
    estimate = estimate_dynamics(problem, decisions)
    np.testing.assert_allclose(estimate[[0, 1, 2, 4, 5, 6]], table[[0, 1, 2, 4, 5, 6]], atol=0.05)


def test_two_rows_determine_the_table_of_every_density():
    rows = truth_rows()
    table = full_table(rows)
    assert table.shape == (len(DENSITIES_PM2) * 4, 5)
    np.testing.assert_allclose(table[: len(DENSITY_MODEL_NAMES)], rows, rtol=1e-12)
    models = with_density(PLAIN, np.zeros(GRID.n_states)).outcome_models
    parameters = models.parameters_of(table)
    np.testing.assert_allclose(models.local_probabilities(parameters), table, rtol=1e-9)
    assert full_table(np.stack([rows, rows])).shape == (2, *table.shape)


def test_outcomes_of_random_crowds_are_means_over_densities_around_the_mean():
    linear = np.repeat(DENSITIES_PM2 / 3.0, 4)
    table = np.stack([linear, 1.0 - linear], axis=1)
    mixed = in_random_crowds(table)
    np.testing.assert_allclose(mixed.sum(axis=1), 1.0, atol=1e-12)
    few = np.repeat(DENSITIES_PM2, 4) <= 1.5  # larger ones reach the end of the table
    np.testing.assert_allclose(mixed[few], table[few], atol=0.02)
    np.testing.assert_array_equal(mixed[:4], table[:4])  # where no people are, none come
    np.testing.assert_allclose(in_random_crowds(table[None])[0], mixed)


def test_the_kernels_of_all_people_add_up_to_their_number():
    rng = np.random.default_rng(0)
    people = rng.uniform(3.0, 7.0, (12, 2))
    fine = (np.stack(np.meshgrid(np.arange(100), np.arange(100)), axis=2).reshape(-1, 2) + 0.5) / 10
    assert 0.01 * crowd_shares(fine, people).sum() == pytest.approx(12.0, rel=1e-3)


def test_the_first_rows_are_those_without_people_and_at_1_person_per_m2():
    assert DENSITIES_PM2[:2].tolist() == [0.0, 1.0]
    assert DENSITY_MODEL_NAMES[:4] == MODEL_NAMES
