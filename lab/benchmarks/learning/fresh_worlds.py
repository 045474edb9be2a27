"""Random worlds to compare learners on: gridworlds of three terrains, and random MDPs.

Each has demonstrations of a soft expert, and another task with the same rewards and dynamics.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.ndimage

from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import transitions_of
from serd_core.grid.grid import Grid
from serd_core.learners.mdce_irl import state_action_occupancy
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.solved_policy import soft_policy

SIDE, N_TERRAINS = 8, 3
N_STATES, N_MODELS = 25, 10
DISCOUNT, N_STEPS = 0.95, 20


@dataclass(frozen=True, eq=False)
class World:
    """A problem, a transfer problem, (F,) weights and (M, K) true outcome probabilities."""

    problem: TabularProblem
    transfer: TabularProblem
    weights: FloatArray
    truth: FloatArray

    def demonstrations(self, n_episodes: int, rng: np.random.Generator) -> Decisions:
        """Episodes from random states."""
        return sample_decisions(
            self.problem.mdp,
            self.policy(self.problem),
            self.truth,
            np.full(self.problem.mdp.n_states, 1.0 / self.problem.mdp.n_states),
            n_episodes=n_episodes,
            n_steps=N_STEPS,
            rng=rng,
        )

    def policy(self, problem: TabularProblem) -> FloatArray:
        """(S, A) the expert's policy in the problem or in the transfer problem."""
        return soft_policy(problem, self.weights, self.truth).probabilities

    def log_likelihood(self, problem: TabularProblem, policy: FloatArray) -> float:
        """Of the expert's decisions under an (S, A) policy, per decision, less that of its own."""
        ratio = np.log(policy / self.policy(problem))
        return float(np.sum(self.decision_weights(problem) * ratio))

    def decision_weights(self, problem: TabularProblem) -> FloatArray:
        """(S, A) share of the expert's discounted decisions, from random starts."""
        starts = np.full(problem.mdp.n_states, 1.0 / problem.mdp.n_states)
        transitions = transitions_of(problem.mdp.transitions, self.truth)
        visits = state_action_occupancy(problem.mdp, transitions, self.policy(problem), starts)
        return np.asarray(visits / visits.sum())


def grid_world(rng: np.random.Generator) -> World:
    """8 x 8 cells of three terrains; a move goes ahead, aside, back or nowhere by its terrain."""
    truth = _relative_moves(rng)
    weights = np.concatenate([[rng.uniform(1.0, 5.0)], -rng.uniform(0.0, 2.0, N_TERRAINS - 1)])
    return World(_grid_problem(rng), _grid_problem(rng), weights, truth)


def random_world(rng: np.random.Generator) -> World:
    """25 states, 4 actions, 10 outcome models of 4 outcomes, 4 features."""
    truth = 0.98 * rng.dirichlet(np.full(4, 0.5), N_MODELS) + 0.02 / 4
    rng.dirichlet(np.full(4, 0.5), N_MODELS)  # drawn so that worlds are those that were measured
    return World(_random_problem(rng), _random_problem(rng), rng.normal(size=4), truth)


FAMILIES: dict[str, Callable[[np.random.Generator], World]] = {
    "gridworlds": grid_world,
    "random MDPs": random_world,
}


def _relative_moves(rng: np.random.Generator) -> FloatArray:
    """(12, 5) outcomes stay, up, right, down, left of each terrain and move."""
    table = np.zeros((N_TERRAINS * 4, 5))
    for terrain in range(N_TERRAINS):
        ahead = rng.uniform(0.4, 0.95)
        other = (1.0 - ahead) * rng.dirichlet(np.array([1.0, 1.0, 0.3, 1.0]))
        stay, right, back, left = other
        for move in range(4):
            turned = [0] + [1 + (move + turn) % 4 for turn in range(4)]
            table[terrain * 4 + move, turned] = [stay, ahead, right, back, left]
    return 0.98 * table + 0.02 / 5


def _grid_problem(rng: np.random.Generator) -> TabularProblem:
    grid = Grid(origin_m=(0, 0), cell_size_m=1.0, walkable=np.ones((SIDE, SIDE), bool))
    height = scipy.ndimage.gaussian_filter(rng.normal(size=(SIDE, SIDE)), 1.0).ravel()
    terrain = np.searchsorted(np.quantile(height, [0.4, 0.7]), height)
    successors = np.repeat(grid.neighbours[:, None, :], 4, axis=1)
    model_of = 4 * terrain[:, None] + np.arange(4)
    models = OutcomeModels(successors, model_of, np.ones((SIDE**2, 4), bool), 4 * N_TERRAINS)
    features = np.zeros((SIDE**2, 4, N_TERRAINS))
    features[rng.integers(SIDE**2), :, 0] = 1.0
    for kind in range(1, N_TERRAINS):
        features[terrain == kind, :, kind] = 1.0
    return TabularProblem(Mdp(models, DISCOUNT), features, ("goal", "terrain 1", "terrain 2"))


def _random_problem(rng: np.random.Generator) -> TabularProblem:
    models = OutcomeModels(
        rng.integers(N_STATES, size=(N_STATES, 4, 4)),
        rng.integers(N_MODELS, size=(N_STATES, 4)),
        np.ones((N_STATES, 4), bool),
        N_MODELS,
    )
    features = np.repeat(rng.normal(size=(N_STATES, 1, 4)), 4, axis=1)
    return TabularProblem(Mdp(models, DISCOUNT), features, ("a", "b", "c", "d"))
