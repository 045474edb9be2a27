"""Small problems that several tests share."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import NavigationProblem, build_navigation_problem
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior.parameters import Block
from serd_core.priors.divergence import DirichletPrior
from serd_core.priors.prior import GaussianPrior

#: A density over rewards and dynamics.
PROPER = GaussianPrior(2.0, Block.REWARD) + DirichletPrior(0.7)


def sampled(
    problem: TabularProblem,
    policy: FloatArray,
    table: FloatArray | None,
    n_episodes: int,
    n_steps: int,
    seed: int | np.random.Generator = 0,
    starts: ArrayLike | None = None,
) -> Decisions:
    """Episodes by a policy, which start in any state alike or by the (S,) chances of starts."""
    n_states, rng = problem.mdp.n_states, np.random.default_rng(seed)
    starts = np.full(n_states, 1.0 / n_states) if starts is None else np.asarray(starts)
    return sample_decisions(
        problem.mdp, policy, table, starts, n_episodes=n_episodes, n_steps=n_steps, rng=rng
    )


def apart(state: ArrayLike, action: ArrayLike, next_state: ArrayLike) -> Decisions:
    """Decisions of one episode each."""
    n = len(np.atleast_1d(next_state))
    columns = (np.broadcast_to(column, n) for column in (state, action, next_state))
    return Decisions(np.arange(n), np.zeros(n), *columns)


def room(
    rows: int, columns: int, goal: int, flow: ArrayLike = Action.NORTH, discount: float = 0.95
) -> NavigationProblem:
    """Cells of 1 m without walls in between, and people who walk north or by the flow."""
    grid = Grid((0.0, 0.0), 1.0, np.ones((rows, columns), bool))
    return build_navigation_problem(
        grid=grid,
        flow=np.broadcast_to(flow, grid.n_states),
        goal_states=[goal],
        wall_distance_m=np.ones(grid.n_states),
        discount=discount,
    )


def always(problem: NavigationProblem, action: int) -> FloatArray:
    """The policy that takes one action and waits at the goal."""
    policy = np.tile(np.eye(5)[action], (problem.mdp.n_states, 1))
    policy[problem.goal_states] = np.eye(5)[Action.WAIT]
    return policy


def one_choice(n_first: int, n_second: int) -> tuple[TabularProblem, Decisions]:
    """One state, two actions, one feature of the first action, discount 0: a logistic model.

    A second state, which is never left, makes outcomes: both actions share one model of two.
    """
    successors = np.zeros((2, 2, 2), int)
    successors[0], successors[1] = [0, 1], 1
    models = OutcomeModels(successors, np.zeros((2, 2), int), np.ones((2, 2), bool), 1)
    features = np.array([[[1.0], [0.0]], [[0.0], [0.0]]])
    actions = np.repeat([0, 1], [n_first, n_second])
    decisions = apart(0, actions, (np.arange(len(actions)) % 3 == 0) * 1)
    return TabularProblem(Mdp(models, 0.0), features, ("first",)), decisions


@dataclass(frozen=True, eq=False)
class Case:
    """A problem with the truth that made its decisions."""

    problem: TabularProblem
    weights: np.ndarray
    probabilities: np.ndarray
    decisions: Decisions


def fit_of(
    case: Case, weights: ArrayLike, fit: Callable[..., FitResult] = fit_mdce_serd, **options: Any
) -> FitResult:
    """The fit of the decisions of a case, which starts at the weights."""
    start = np.array(weights, dtype=np.float64)
    return fit(case.problem, case.decisions, initial_weights=start, **options)


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
        decisions = sampled(problem, policy, truth, n_episodes, n_steps, seed)
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
    return problem, apart(0, 0, np.repeat([0, 1], [9, 3]))
