"""Demonstrations in the hallway in which moves take time."""

import numpy as np

from serd_app.learning.recipe import task_in
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.demonstrations.simulation import sample_timed_decisions
from serd_core.policies.solved_policy import soft_policy
from serd_core.semi_markov.models import require_timed
from serd_sim.scenario.grid import start_states_of
from serd_sim.scenario.scenario import load_scenario
from tests.conftest import OUTCOMES

TASK = task_in(load_scenario("hallway"), 0.97)
MEAN_S = np.array([0.8, 2.5, 1.1])


def timed_decisions(n_episodes: int = 3) -> TimedDecisions:
    """Of a soft expert who knows how long moves take; some are ended by another command."""
    problem = TASK.problem
    models = require_timed(problem.mdp.transitions)
    truth = models.parameters_from(np.array(list(OUTCOMES.values())), MEAN_S, 8.0)
    expert = soft_policy(problem, np.array([4.0, 1.0, -0.2]), models.local_probabilities(truth))
    starts = np.zeros(problem.grid.n_states)
    starts[start_states_of(load_scenario("hallway"), problem.grid, "train")] = 1.0
    return sample_timed_decisions(
        problem.mdp,
        expert.probabilities,
        truth,
        starts / starts.sum(),
        n_episodes=n_episodes,
        n_steps=60,
        rng=np.random.default_rng(2),
        mean_until_command_s=10.0,
    )
