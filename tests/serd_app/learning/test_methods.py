"""The uniform prior of the methods, and what they learn with it."""

from pathlib import Path

import numpy as np
import pytest

from serd_app.demonstrations.discretise import demonstrations_of_bag
from serd_app.learning.methods import fit_data, mdce_serd_free, uniform_prior
from serd_app.learning.settings import RecipeSettings
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.grid import Grid
from serd_core.grid.navigation import NO_FLOW, build_navigation_problem
from serd_core.posterior.parameters import Block, Parameters
from serd_sim.scenario.grid import navigation_problem_of
from serd_sim.scenario.scenario import load_scenario

HALLWAY = load_scenario("hallway")
TRAINING = Path(__file__).parents[3] / "bags" / "data" / "hallway" / "training"


@pytest.fixture(scope="module")
def problem():
    return navigation_problem_of(HALLWAY, 0.99)


def log_prior(problem, probabilities):
    model = problem.mdp.transitions
    theta = model.parameters_of(probabilities)
    parameters = Parameters(np.zeros(3), theta, theta, np.zeros(0))
    return uniform_prior(problem, Block.TRUTH, pseudo_count=1.5).evaluate(model, parameters).value


def test_it_is_the_sum_of_the_log_probabilities_up_to_a_constant(problem):
    rng = np.random.default_rng(1)
    first, second = rng.dirichlet(np.ones(5), (2, 4))
    expected = 1.5 * (np.log(first).sum() - np.log(second).sum())
    assert log_prior(problem, first) - log_prior(problem, second) == pytest.approx(expected)


def test_outcomes_that_walls_make_one_everywhere_count_together():
    # A corridor one cell wide and without flow: the models with and against the flow act nowhere,
    # and every move has walls on two sides.
    problem = build_navigation_problem(
        grid=Grid((0.0, 0.0), 1.0, np.ones((6, 1), dtype=bool)),
        flow=np.full(6, NO_FLOW),
        goal_states=[5],
        wall_distance_m=np.ones(6),
        discount=0.9,
    )
    across, waiting = (problem.model_names.index(name) for name in ("across_flow", "waiting"))
    first, second = np.random.default_rng(1).dirichlet(np.ones(5), (2, 4))
    second[waiting] = first[waiting]

    def expected(row):
        stay, forward, right, back, left = row
        along = 3 * np.log(stay + right + left) + np.log(forward) + np.log(back)
        sideways = 3 * np.log(stay + forward + back) + np.log(right) + np.log(left)
        return 1.5 * (along + sideways) / 2

    found = log_prior(problem, first) - log_prior(problem, second)
    assert found == pytest.approx(expected(first[across]) - expected(second[across]))


def test_with_a_free_belief_the_truth_is_the_m_estimate(problem):
    patience_s, wait_s = HALLWAY.patience_s, HALLWAY.wait_s
    found = demonstrations_of_bag(TRAINING, problem.grid, patience_s, wait_s)[0]
    subset = found.select_episodes(range(4))
    data = fit_data(problem, subset, RecipeSettings(), np.random.default_rng(0))
    fit = mdce_serd_free(data).fit
    assert fit.converged
    np.testing.assert_allclose(
        fit.outcome_probabilities, estimate_dynamics(problem, subset), atol=2e-3
    )
