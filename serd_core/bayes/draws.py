"""What follows from draws of a posterior: credible intervals and the policy averaged over them.

    P(a | s, D) = E[ pi_theta(a | s) | D ]

This average predicts the expert's next decision better than the policy of one point, as it admits
what the demonstrations leave open (MacKay, Neural Computation 4, 1992, section 4.2).
"""

from dataclasses import dataclass, fields

import numpy as np

from serd_core.arrays import FloatArray, IntArray, require_count, require_generator
from serd_core.bayes.laplace import Laplace
from serd_core.dynamics.transition_model import transitions_of
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import solution_at
from serd_core.posterior.coordinates import Coordinates
from serd_core.posterior.parameters import Block

#: Draws that a summary takes unless another number is asked for.
N_DRAWS = 40


@dataclass(frozen=True, eq=False)
class PosteriorDraws:
    """n draws of what is learned.

    coordinates: (n, d); reward: (n, F) weights; truth: (n, N) parameters of the dynamics;
    outcome_probabilities, believed_outcome_probabilities: (n, M, K), which are discounted where
    moves take time (`SemiMarkovModels`).
    """

    coordinates: FloatArray
    reward: FloatArray
    truth: FloatArray
    outcome_probabilities: FloatArray
    believed_outcome_probabilities: FloatArray

    def __len__(self) -> int:
        return len(self.reward)

    def select(self, rows: IntArray | slice) -> "PosteriorDraws":
        """The draws of the given rows."""
        return PosteriorDraws(*(getattr(self, each.name)[rows] for each in fields(self)))


def draws_at(problem: Problem, space: Coordinates, coordinates: FloatArray) -> PosteriorDraws:
    """The draws at (n, d) coordinates."""
    at, model = [space.parameters(u) for u in coordinates], problem.mdp.transitions
    truth, belief = (
        np.stack([each.block(block) for each in at]) for block in (Block.TRUTH, Block.BELIEF)
    )
    tables = (model.local_probabilities(each) for each in (truth, belief))
    return PosteriorDraws(coordinates, np.stack([each.reward for each in at]), truth, *tables)


def laplace_draws(found: Laplace, rng: np.random.Generator, n: int = N_DRAWS) -> PosteriorDraws:
    """n draws of the posterior that start at Laplace's approximation (`Laplace.sample`)."""
    require_count("n", n, 2, f"{N_DRAWS}")
    require_generator(rng)
    return draws_at(found.problem, found.coordinates, found.sample(n, rng))


def posterior_policy(problem: Problem, draws: PosteriorDraws) -> FloatArray:
    """(S, A) soft policy averaged over the draws, of the problem they are of or of another task."""
    return averaged_policy(problem, draws.reward, draws.believed_outcome_probabilities)


def averaged_policy(
    problem: Problem, reward_weights: FloatArray, outcome_probabilities: FloatArray
) -> FloatArray:
    """(S, A) mean of the soft policies of (n, F) reward weights and (n, M, K) dynamics."""
    total, value = np.zeros(problem.mdp.available.shape), None
    for weights, table in zip(reward_weights, outcome_probabilities, strict=True):
        transitions = transitions_of(problem.mdp.transitions, table)
        solution = solution_at(problem, weights, transitions, initial_value=value)
        total, value = total + solution.policy, solution.value
    return np.asarray(total / len(reward_weights))
