"""Small problems that several tests share."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.grid.grid import Grid
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.solved_policy import soft_policy


@dataclass(frozen=True, eq=False)
class Case:
    """A problem with the truth that made its decisions."""

    problem: TabularProblem
    weights: np.ndarray
    probabilities: np.ndarray
    decisions: Decisions


def gridworld_problem(side: int, discount: float, seed: int = 0) -> TabularProblem:
    """Two terrains, five actions, nine models as in section 4.6.2; goal at the top."""
    grid = Grid(origin_m=(0, 0), cell_size_m=1.0, walkable=np.ones((side, side), bool))
    brightness = np.random.default_rng(seed).random(grid.n_states)
    forest = brightness < 0.5
    successors = np.repeat(grid.neighbours[:, None, :], 5, axis=1)
    model_of = np.where(forest[:, None], 4, 0) + np.arange(5)[None, :]
    model_of[:, 0] = 0
    models = OutcomeModels(successors, model_of, np.ones((grid.n_states, 5), bool), n_models=9)
    features = np.zeros((grid.n_states, 5, 2))
    features[:, :, 0] = brightness[:, None]
    features[grid.n_states - side // 2 - 1, :, 1] = 1.0
    return TabularProblem(Mdp(models, discount), features, ("brightness", "goal"))


def gridworld_truth() -> np.ndarray:
    """(9, 5) outcomes of section 4.6.2: waiting is certain, forest is noisier than open terrain."""
    table = np.zeros((9, 5))
    table[0, 0] = 1.0
    for action in range(1, 5):
        table[action, [action, action % 4 + 1, (action + 2) % 4 + 1]] = [0.8, 0.1, 0.1]
        table[4 + action] = 0.175
        table[4 + action, action] = 0.3
    return table


@pytest.fixture(scope="session")
def make_gridworld() -> Callable[..., Case]:
    """Factory of gridworld cases with sampled soft decisions."""

    def make(
        side: int = 5, discount: float = 0.9, n_episodes: int = 20, n_steps: int = 15, seed: int = 1
    ) -> Case:
        problem = gridworld_problem(side, discount)
        weights, truth = np.array([2.0, 3.0]), gridworld_truth()
        policy = soft_policy(problem, weights, truth).probabilities
        starts = np.full(side * side, 1.0 / side**2)
        decisions = sample_decisions(
            problem.mdp,
            policy,
            truth,
            starts,
            n_episodes=n_episodes,
            n_steps=n_steps,
            rng=np.random.default_rng(seed),
        )
        return Case(problem, weights, truth, decisions)

    return make


@pytest.fixture(scope="session")
def gridworld(make_gridworld) -> Case:
    """25 states, discount 0.9, 300 decisions."""
    return make_gridworld()


def minimum_example_problem(discount: float) -> TabularProblem:
    """Figure 4.2: actions a, b in state 1, action c in state 2, feature -1 and +1."""
    successors = np.zeros((2, 3, 2), dtype=int)
    successors[0, :2] = [0, 1]
    successors[1, 2] = 1
    model_of = np.array([[0, 1, 0], [0, 0, 0]])
    available = np.array([[True, True, False], [False, False, True]])
    models = OutcomeModels(successors, model_of, available, n_models=2)
    features = np.array([-1.0, 1.0])[:, None, None] * np.ones((2, 3, 1))
    return TabularProblem(Mdp(models, discount), features, ("state",))


@pytest.fixture
def minimum_example() -> TabularProblem:
    """The two-state example with discount 0.9."""
    return minimum_example_problem(0.9)


@pytest.fixture(scope="session")
def random_problem() -> Callable[..., tuple[TabularProblem, np.ndarray]]:
    """Factory of random problems with masked actions; gives problem and outcome table."""

    def make(seed: int, discount: float = 0.9) -> tuple[TabularProblem, np.ndarray]:
        rng = np.random.default_rng(seed)
        n_states, n_actions, n_outcomes, n_models = rng.integers([2, 2, 1, 1], [9, 5, 5, 4])
        available = rng.random((n_states, n_actions)) < 0.7
        available[np.arange(n_states), rng.integers(n_actions, size=n_states)] = True
        models = OutcomeModels(
            rng.integers(n_states, size=(n_states, n_actions, n_outcomes)),
            rng.integers(n_models, size=(n_states, n_actions)),
            available,
            int(n_models),
        )
        features = rng.normal(size=(n_states, n_actions, 2))
        problem = TabularProblem(Mdp(models, discount), features, ("one", "two"))
        return problem, rng.dirichlet(np.ones(n_outcomes), size=n_models)

    return make


@pytest.fixture
def counted():
    """One action, whose two outcomes were seen 9 and 3 times: a beta posterior, and no choices."""
    successors = np.zeros((2, 1, 2), int)
    successors[0, 0], successors[1, 0] = [0, 1], 1
    models = OutcomeModels(successors, np.zeros((2, 1), int), np.ones((2, 1), bool), 1)
    problem = TabularProblem(Mdp(models, 0.5), np.ones((2, 1, 1)), ("constant",))
    zeros = np.zeros(12, int)
    following = np.repeat([0, 1], [9, 3])
    return problem, Decisions(np.arange(12), zeros * 1.0, zeros, zeros, following)
