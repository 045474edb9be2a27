"""Small worlds of different kinds, in which posteriors are calibrated."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import build_navigation_problem
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem, TabularProblem
from serd_core.semi_markov.models import semi_markov_problem


@dataclass(frozen=True, eq=False)
class Family:
    """A problem, and how many episodes and decisions of each demonstrate in it."""

    problem: Problem
    n_episodes: int
    n_steps: int


def random_mdp() -> Family:
    """Five states, two actions with an outcome model of three outcomes each, one feature."""
    rng = np.random.default_rng(0)
    models = OutcomeModels(
        rng.integers(5, size=(5, 2, 3)), np.tile([0, 1], (5, 1)), np.ones((5, 2), bool), 2
    )
    features = np.repeat(rng.normal(size=(5, 1, 1)), 2, axis=1)
    return Family(TabularProblem(Mdp(models, 0.8), features, ("one",)), 20, 10)


def grid_with_borders() -> Family:
    """4 x 4 cells of two terrains; at the border several outcomes stay."""
    grid = Grid(origin_m=(0, 0), cell_size_m=1.0, walkable=np.ones((4, 4), bool))
    terrain = np.arange(16) % 3 == 0
    successors = np.repeat(grid.neighbours[:, None, :], 4, axis=1)
    model_of = 4 * terrain[:, None] + np.arange(4)
    models = OutcomeModels(successors, model_of, np.ones((16, 4), bool), 8)
    features = np.zeros((16, 4, 2))
    features[15, :, 0], features[terrain, :, 1] = 1.0, 1.0
    return Family(TabularProblem(Mdp(models, 0.9), features, ("goal", "terrain")), 8, 12)


def aliased_outcomes() -> Family:
    """A ring in which two of three outcomes of each move stay."""
    state = np.arange(6)
    ways = [((state + step) % 6, state, state) for step in (1, -1)]
    successors = np.stack([np.stack(way, axis=1) for way in ways], axis=1)
    models = OutcomeModels(successors, np.tile([0, 1], (6, 1)), np.ones((6, 2), bool), 2)
    features = np.zeros((6, 2, 2))
    features[0, :, 0], features[:, 0, 1] = 1.0, 1.0
    return Family(TabularProblem(Mdp(models, 0.85), features, ("goal", "first move")), 8, 8)


def rare_hazard() -> Family:
    """A chain with a safe and a fast move; either may fall into a pit that nothing leaves."""
    n = 7
    state, pit = np.arange(n), n - 1
    onward, further = np.minimum(state + 1, pit - 1), np.minimum(state + 2, pit - 1)
    rows = [(onward, state, np.full(n, pit)), (further, state, np.full(n, pit))]
    successors = np.stack([np.stack(row, axis=1) for row in rows], axis=1)
    successors[pit] = pit
    available = np.ones((n, 2), bool)
    available[pit, 1] = False
    models = OutcomeModels(successors, np.tile([0, 1], (n, 1)), available, 2)
    features = np.zeros((n, 2, 2))
    features[pit - 1, :, 0], features[pit, :, 1] = 1.0, 1.0
    return Family(TabularProblem(Mdp(models, 0.9), features, ("goal", "pit")), 6, 10)


def confounded() -> Family:
    """A ring on which one direction has a model of its own, and a feature that explains as much."""
    state = np.arange(8)
    ways = [((state + step) % 8, state, (state - step) % 8) for step in (1, -1)]
    successors = np.stack([np.stack(way, axis=1) for way in ways], axis=1)
    models = OutcomeModels(successors, np.tile([0, 1], (8, 1)), np.ones((8, 2), bool), 2)
    features = np.zeros((8, 2, 2))
    features[0, :, 0], features[:, 1, 1] = 1.0, 1.0
    return Family(TabularProblem(Mdp(models, 0.9), features, ("goal", "against")), 6, 8)


def _hallway() -> Problem:
    grid = Grid((0.0, 0.0), 1.0, np.ones((5, 3), bool))
    flow = np.tile([Action.NORTH, Action.NORTH, Action.SOUTH], 5)
    wall_m = np.tile([0.5, 1.5, 0.5], 5)
    return build_navigation_problem(
        grid=grid, flow=flow, goal_states=[13], wall_distance_m=wall_m, discount=0.9
    )


def hallway() -> Family:
    """Three lanes of people, with the models and features of the robot."""
    return Family(_hallway(), 6, 12)


def hallway_with_durations() -> Family:
    """The same, in which moves take time."""
    return Family(semi_markov_problem(_hallway()), 6, 12)


FAMILIES: dict[str, Callable[[], Family]] = {
    "random MDP": random_mdp,
    "grid with borders": grid_with_borders,
    "aliased outcomes": aliased_outcomes,
    "rare hazard": rare_hazard,
    "confounded": confounded,
    "hallway": hallway,
    "hallway with durations": hallway_with_durations,
}
