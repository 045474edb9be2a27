"""Families of random worlds with a known truth, each with another task to transfer to.

Every family isolates what makes rewards and dynamics hard to learn together; a number of a world
fixes it, and the demonstrations from it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy.ndimage

import serd_core as sc
from lab.bench.case import Case, Target
from lab.experiments.durations import PLACES, STARTS, DurationsConfig, demonstrate
from lab.experiments.durations import world as ring_world
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.transition_model import transitions_of
from serd_core.grid.grid import Grid
from serd_core.learners.mdce_irl import state_action_occupancy
from serd_core.mdp.problem import TabularProblem

SIDE, N_TERRAINS = 8, 3
N_CELLS, N_STEPS, DISCOUNT = 16, 20, 0.95
N_CHAIN = 12
Expert = Callable[[TabularProblem], FloatArray]


@dataclass(frozen=True, eq=False)
class World:
    """A problem and one to transfer to, (F,) weights and (R, K) true outcome probabilities.

    starts, transfer_starts: (S,) of episodes. expert: (S, A) policy in a problem, None for the soft
    policy of the truth.
    """

    problem: TabularProblem
    transfer: TabularProblem
    weights: FloatArray
    truth: FloatArray
    starts: FloatArray
    transfer_starts: FloatArray
    expert: Expert | None = None

    def policy(self, problem: TabularProblem) -> FloatArray:
        """(S, A) of the expert in one of the problems."""
        if self.expert is not None:
            return self.expert(problem)
        return sc.soft_policy(problem, self.weights, self.truth).probabilities

    def target(self, problem: TabularProblem, starts: FloatArray) -> Target:
        """The expert's decisions by their discounted visits."""
        policy = self.policy(problem)
        transitions = transitions_of(problem.mdp.transitions, self.truth)
        visits = state_action_occupancy(problem.mdp, transitions, policy, starts)
        return Target.of_expert(np.asarray(visits / visits.sum()), policy)

    def demonstrations(self, n: int, rng: np.random.Generator) -> Decisions:
        """Episodes of `N_STEPS` decisions."""
        policy, at = self.policy(self.problem), self.starts
        mdp = self.problem.mdp
        return sc.sample_decisions(
            mdp, policy, self.truth, at, n_episodes=n, n_steps=N_STEPS, rng=rng
        )

    def case(self, decisions: Decisions) -> Case:
        """What is learned from demonstrations, and how it is scored."""
        return Case(
            self.problem,
            decisions,
            self.target(self.problem, self.starts),
            self.transfer,
            self.target(self.transfer, self.transfer_starts),
            self.truth,
            self.weights if self.expert is None else None,
        )


def grid_world(rng: np.random.Generator) -> World:
    """8 x 8 cells of three terrains; a move goes ahead, aside, back or nowhere by its terrain.

    At the border several outcomes of a move lead to one cell.
    """
    table = np.zeros((N_TERRAINS * 4, 5))
    for row in range(N_TERRAINS * 4):
        ahead = rng.uniform(0.4, 0.95)
        stay, right, back, left = (1.0 - ahead) * rng.dirichlet(np.array([1.0, 1.0, 0.3, 1.0]))
        turned = [0] + [1 + (row % 4 + turn) % 4 for turn in range(4)]
        table[row, turned] = [stay, ahead, right, back, left]
    weights = np.concatenate([[rng.uniform(1.0, 5.0)], -rng.uniform(0.0, 2.0, N_TERRAINS - 1)])
    problems = _grid_problem(rng), _grid_problem(rng)
    anywhere = np.full(SIDE**2, 1.0 / SIDE**2)
    return World(*problems, weights, 0.98 * table + 0.02 / 5, anywhere, anywhere)


def _grid_problem(rng: np.random.Generator) -> TabularProblem:
    grid = Grid(origin_m=(0, 0), cell_size_m=1.0, walkable=np.ones((SIDE, SIDE), bool))
    height = scipy.ndimage.gaussian_filter(rng.normal(size=(SIDE, SIDE)), 1.0).ravel()
    terrain = np.searchsorted(np.quantile(height, [0.4, 0.7]), height)
    successors = np.repeat(grid.neighbours[:, None, :], 4, axis=1)
    model_of = 4 * terrain[:, None] + np.arange(4)
    models = sc.OutcomeModels(successors, model_of, np.ones((SIDE**2, 4), bool), 4 * N_TERRAINS)
    features = np.zeros((SIDE**2, 4, N_TERRAINS))
    features[rng.integers(SIDE**2), :, 0] = 1.0
    for kind in range(1, N_TERRAINS):
        features[terrain == kind, :, kind] = 1.0
    return TabularProblem(sc.Mdp(models, DISCOUNT), features, ("goal", "terrain 1", "terrain 2"))


def misspecified_world(rng: np.random.Generator) -> World:
    """The gridworlds, whose experts are greedy but for a tenth, or Boltzmann over optimal Q."""
    world = grid_world(rng)
    greedy, temperature = rng.random() < 0.5, rng.uniform(0.3, 1.0)

    def expert(problem: TabularProblem) -> FloatArray:
        if greedy:
            best = sc.optimal_policy(problem, world.weights, world.truth).probabilities
            return np.asarray(0.9 * best + 0.1 / best.shape[1])
        return sc.boltzmann_policy(problem, world.weights, world.truth, temperature).probabilities

    return replace(world, expert=expert)


def _ring_problem(floor: IntArray, goal: int, n_stays: int) -> TabularProblem:
    """Cells of two floors in a ring; a move to either side goes on, or stays in n_stays ways."""
    cell, sides = np.arange(N_CELLS), np.array([1, -1])
    onward = (cell[:, None] + sides) % N_CELLS
    staying = np.broadcast_to(cell[:, None, None], (N_CELLS, 2, n_stays))
    successors = np.concatenate([onward[:, :, None], staying], axis=2)
    model_of = 2 * floor[:, None] + np.arange(2)
    models = sc.OutcomeModels(successors, model_of, np.ones((N_CELLS, 2), bool), 4)
    features = np.zeros((N_CELLS, 2, 2))
    features[goal, :, 0], features[floor > 0, :, 1] = 1.0, 1.0
    return TabularProblem(sc.Mdp(models, DISCOUNT), features, ("goal", "floor"))


def aliased_world(rng: np.random.Generator) -> World:
    """A ring of two floors where three of the four outcomes of each move stay in the cell."""
    onward = rng.uniform(0.3, 0.95, 4)
    truth = np.column_stack([onward, (1 - onward)[:, None] * rng.dirichlet(np.ones(3), 4)])

    def drawn() -> TabularProblem:
        return _ring_problem(rng.integers(2, size=N_CELLS), int(rng.integers(N_CELLS)), 3)

    problems = drawn(), drawn()
    weights = np.array([rng.uniform(1.0, 4.0), rng.uniform(-1.5, 1.5)])
    anywhere = np.full(N_CELLS, 1.0 / N_CELLS)
    return World(*problems, weights, 0.98 * truth + 0.02 / 4, anywhere, anywhere)


def confounded_world(rng: np.random.Generator) -> World:
    """Two ways round a ring; experts avoid the floor of one, as it is disliked, slow, or both."""
    cell = np.arange(N_CELLS)
    problem = _ring_problem((cell > N_CELLS // 2).astype(np.int64), 0, 1)
    transfer = _ring_problem(((cell > 1) & (cell < 7)).astype(np.int64), 12, 1)
    fair, other = rng.uniform(0.8, 0.95), rng.uniform(0.15, 0.8)
    onward = np.array([fair, fair, other, other])
    weights = np.array([rng.uniform(2.0, 5.0), -rng.uniform(0.0, 1.5)])
    starts, there = np.zeros(N_CELLS), np.zeros(N_CELLS)
    starts[N_CELLS // 2], there[[0, 8]] = 1.0, 0.5
    return World(problem, transfer, weights, np.column_stack([onward, 1 - onward]), starts, there)


def hazard_world(rng: np.random.Generator) -> World:
    """A chain with a fast move, which rarely ends in a costly fall, and a careful one."""
    fall = rng.uniform(0.005, 0.05)
    truth = np.array([[0.9 - fall, 0.1, fall], [0.799, 0.2, 0.001], [0.34, 0.33, 0.33]])
    weights = np.array([rng.uniform(2.0, 5.0), -rng.uniform(5.0, 20.0)])
    problems = _chain_problem(N_CHAIN - 1), _chain_problem(N_CHAIN // 2)
    starts = np.zeros(N_CHAIN + 1)
    starts[:4] = 0.25
    return World(*problems, weights, truth, starts, starts)


def _chain_problem(goal: int) -> TabularProblem:
    """Cells 0 to N_CHAIN - 1, then the pit; goal and pit lead back to the first cell."""
    state, pit = np.arange(N_CHAIN + 1), N_CHAIN
    ahead = [np.minimum(state + step, N_CHAIN - 1) for step in (2, 1)]
    successors = np.stack(
        [np.stack([there, state, np.full_like(state, pit)], axis=1) for there in ahead], axis=1
    )
    model_of, available = np.tile([0, 1], (len(state), 1)), np.ones((len(state), 2), bool)
    for end in (goal, pit):
        successors[end], model_of[end] = 0, 2
    features = np.zeros((len(state), 2, 2))
    features[goal, :, 0], features[pit, :, 1] = 1.0, 1.0
    models = sc.OutcomeModels(successors, model_of, available, 3)
    return TabularProblem(sc.Mdp(models, DISCOUNT), features, ("goal", "fall"))


Family = Callable[[np.random.Generator], World]


def case_of_world(family: Family, size: int, rng: np.random.Generator) -> Case:
    """A world of the family, and `size` demonstrations."""
    world = family(rng)
    return world.case(world.demonstrations(size, rng))


def case_of_durations(_: Path, size: int, rng: np.random.Generator) -> Case:
    """A ring with a stream of people, against which moves take three times as long.

    Robots of the transfer task start nearer to the goal, where the way against the stream is right.
    """
    config = DurationsConfig(sizes=(size,))
    given = ring_world(config, "side outcomes", rng)
    decisions = demonstrate(given, rng)
    starts, there = np.zeros(2 * PLACES), np.zeros(2 * PLACES)
    for places, at in ((STARTS, starts), (np.array(config.distances), there)):
        at[np.concatenate([2 * places, 2 * places + 1])] = 0.5 / len(places)
    weights = np.array([config.goal_weight])
    world = World(given.timed, given.timed, weights, given.table, starts, there)
    return world.case(decisions)
