"""The gridworld of section 4.6.2 in any size, with demonstrations and the objective of a fit."""

import numpy as np

from lab.experiments.gridworld.landscape import generated_landscape
from lab.experiments.gridworld.problem import N_OUTCOMES, Gridworld, gridworld, true_dynamics
from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import observe
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import MdcePolicy, soft_policy
from serd_core.posterior.posterior import Posterior
from serd_core.priors.prior import UniformPrior

WEIGHTS = np.array([6.0, 6.0])
#: The thesis's dynamics, one part in a hundred of them uniform so that every outcome can happen.
DYNAMICS = 0.99 * true_dynamics() + 0.01 / N_OUTCOMES


def landscape_problem(side: int, discount: float) -> Gridworld:
    """The generated landscape that ships with the experiment, `side` cells a side."""
    landscape = generated_landscape(side, np.random.default_rng([0, 2, 0]))
    return gridworld(landscape, discount, goal_at_left=False)


def demonstrations(
    world: Gridworld, n_episodes: int, n_steps: int, starts: FloatArray | None = None
) -> Decisions:
    """Episodes of a soft expert with WEIGHTS and DYNAMICS; starts (S,): other than the world's."""
    policy = soft_policy(world.problem, WEIGHTS, DYNAMICS).probabilities
    return sample_decisions(
        world.problem.mdp,
        policy,
        DYNAMICS,
        world.starts if starts is None else starts,
        n_episodes=n_episodes,
        n_steps=n_steps,
        rng=np.random.default_rng(0),
    )


def objective_of(problem: Problem, decisions: Decisions) -> Posterior:
    """The log posterior of MDCE SERD without a prior, solved as in a fit."""
    return Posterior(problem, observe(problem, decisions), MdcePolicy(), UniformPrior())
