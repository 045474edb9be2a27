"""Small worlds of different kinds, in which posteriors are calibrated."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import build_navigation_problem
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem, TabularProblem
from serd_core.posterior.coordinates import feature_ranges
from serd_core.posterior.parameters import Block
from serd_core.priors.divergence import DirichletPrior, require_outcome_models
from serd_core.priors.prior import GaussianPrior, Prior
from serd_core.semi_markov.dwell_likelihood import DwellPrior
from serd_core.semi_markov.models import SemiMarkovModels, semi_markov_problem


@dataclass(frozen=True, eq=False)
class Family:
    """A problem, and how many episodes and decisions of each demonstrate in it.

    deviations: of its reward weights, in nats over the range of a feature, one or (F,);
    pseudo_counts: of its outcomes, one or (K,).
    """

    problem: Problem
    n_episodes: int
    n_steps: int
    deviations: float | tuple[float, ...] = 2.0
    pseudo_counts: float | tuple[float, ...] = 1.0

    def prior(self) -> Prior:
        """The prior that its weights and dynamics are drawn from."""
        model = self.problem.mdp.transitions
        deviations = np.asarray(self.deviations / feature_ranges(self.problem))
        n_outcomes = require_outcome_models(model, "a family").n_outcomes
        counts = np.ones(n_outcomes) * self.pseudo_counts
        of_weights: Prior = GaussianPrior(tuple(deviations.tolist()), Block.REWARD)
        prior = of_weights + CountedPrior(1.0, of_outcomes=tuple(counts.tolist()))
        return prior + DwellPrior(1.0) if isinstance(model, SemiMarkovModels) else prior


@dataclass(frozen=True)
class CountedPrior(DirichletPrior):
    """A Dirichlet prior with a pseudo-count (K,) of its own for each outcome of all models."""

    of_outcomes: tuple[float, ...] = ()

    def counts(self, models: OutcomeModels) -> FloatArray:
        """(M, K) pseudo-counts."""
        return np.asarray(super().counts(models) * np.array(self.of_outcomes))


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
    problem = TabularProblem(Mdp(models, 0.9), features, ("goal", "pit"))
    return Family(problem, 6, 10, deviations=(2.0, 8.0), pseudo_counts=(6.0, 1.5, 0.3))


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


def lake_with_holes() -> Family:
    """A lake of 4 x 4 cells: a move goes ahead or to one side; holes and the goal end it."""
    grid = Grid(origin_m=(0, 0), cell_size_m=1.0, walkable=np.ones((4, 4), bool))
    ends = np.isin(np.arange(16), (5, 7, 11, 12, 15))
    around = np.where(ends[:, None], np.arange(16)[:, None], grid.neighbours[:, 1:])
    move = np.arange(4)
    turned = np.stack([move, (move + 1) % 4, (move - 1) % 4], axis=1)
    available = np.ones((16, 4), bool)
    available[ends, 1:] = False
    models = OutcomeModels(around[:, turned], np.zeros((16, 4), int), available, 1)
    features = np.zeros((16, 4, 2))
    features[15, :, 0], features[[5, 7, 11, 12], :, 1] = 1.0, 1.0
    return Family(TabularProblem(Mdp(models, 0.9), features, ("goal", "hole")), 8, 12)


def stock() -> Family:
    """A store of 0 to 8 goods, of which 0 to 3 are sold a day after none, two or four arrived."""
    stock, ordered = np.arange(9), np.array([0, 2, 4])
    arrived = np.minimum(stock[:, None] + ordered, 8)
    successors = np.maximum(arrived[:, :, None] - np.arange(4), 0)
    models = OutcomeModels(successors, np.tile([0, 1, 1], (9, 1)), np.ones((9, 3), bool), 2)
    features = np.zeros((9, 3, 3))
    features[0, :, 0], features[:, :, 1], features[:, 1:, 2] = 1.0, stock[:, None] / 8.0, 1.0
    names = ("empty", "held", "ordered")
    return Family(TabularProblem(Mdp(models, 0.85), features, names), 8, 10)


def larger_mdp() -> Family:
    """Twelve states, three actions, three models of four outcomes, three features of states."""
    rng = np.random.default_rng(12)
    models = OutcomeModels(
        rng.integers(12, size=(12, 3, 4)), rng.integers(3, size=(12, 3)), np.ones((12, 3), bool), 3
    )
    features = np.repeat(rng.normal(size=(12, 1, 3)), 3, axis=1)
    return Family(TabularProblem(Mdp(models, 0.9), features, ("one", "two", "three")), 8, 10)


def _wind() -> TabularProblem:
    grid = Grid(origin_m=(0, 0), cell_size_m=1.0, walkable=np.ones((5, 5), bool))
    windy = np.arange(25) % 5 == 2
    around = grid.neighbours
    up = around[around[:, 1:], 1]  # (S, A) one cell further by the wind
    successors = np.stack([around[:, 1:], up, np.repeat(around[:, :1], 4, axis=1)], axis=2)
    model_of = np.repeat(windy[:, None].astype(int), 4, axis=1)
    models = OutcomeModels(successors, model_of, np.ones((25, 4), bool), 2)
    features = np.zeros((25, 4, 2))
    features[14, :, 0], features[windy, :, 1] = 1.0, 1.0
    return TabularProblem(Mdp(models, 0.9), features, ("goal", "windy"))


def wind() -> Family:
    """5 x 5 cells; wind moves one cell further, by another probability in one column."""
    return Family(_wind(), 8, 12)


def wind_with_durations() -> Family:
    """The same, in which moves take time."""
    return Family(semi_markov_problem(_wind()), 8, 12)


def room_with_a_door() -> Family:
    """Two rooms of 3 x 3 cells with a door between them, with the robot's models, and no people."""
    walkable = np.ones((7, 3), bool)
    walkable[3, [0, 2]] = False
    grid = Grid((0.0, 0.0), 1.0, walkable)
    far = np.abs(np.arange(grid.n_states) - grid.n_states // 2).astype(float)
    problem = build_navigation_problem(
        grid=grid,
        flow=np.full(grid.n_states, -1),
        goal_states=[grid.n_states - 1],
        wall_distance_m=1.0 + far / 10.0,
        discount=0.9,
    )
    return Family(problem, 6, 12)


#: Written after the threshold of `judge_joint_dynamics` was fixed on `FAMILIES`.
FRESH: dict[str, Callable[[], Family]] = {
    "lake with holes": lake_with_holes,
    "stock": stock,
    "larger MDP": larger_mdp,
    "wind": wind,
    "wind with durations": wind_with_durations,
    "room with a door": room_with_a_door,
}
FAMILIES: dict[str, Callable[[], Family]] = {
    "random MDP": random_mdp,
    "grid with borders": grid_with_borders,
    "aliased outcomes": aliased_outcomes,
    "rare hazard": rare_hazard,
    "confounded": confounded,
    "hallway": hallway,
    "hallway with durations": hallway_with_durations,
}
