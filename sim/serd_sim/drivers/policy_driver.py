"""Drivers by a policy over the states of the grid, for instance that of a learned model."""

import numpy as np
from numpy.typing import ArrayLike

from serd_core.arrays import FloatArray, float_array
from serd_core.arrival.arriving_policy import arriving_policy
from serd_core.arrival.chain import ArrivalByState, arrival_by_state
from serd_core.arrival.law import steps_within
from serd_core.grid.grid import Action, Grid
from serd_core.policies.solved_policy import Policy, optimal_policy
from serd_files.model_file import load_model
from serd_sim.errors import SimError
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.model_problem import problem_of_model
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation
from serd_sim.world.seeds import POLICY, episode_rng


class PolicyDriver:
    """Chooses by `probabilities` (S, 5): the likeliest action, or one drawn when not greedy."""

    def __init__(
        self,
        grid: Grid,
        probabilities: ArrayLike,
        *,
        seed: int = 0,
        greedy: bool = True,
        name: str = "policy",
    ) -> None:
        self._grid, self._seed, self._greedy, self.name = grid, seed, greedy, name
        self._rng = episode_rng(seed, 0, POLICY)
        self.follow(probabilities)

    def follow(self, probabilities: ArrayLike) -> None:
        """Drive by another policy on the same grid from now on, also within an episode."""
        table: FloatArray = float_array(
            "probabilities", probabilities, (self._grid.n_states, len(Action))
        )
        if (table < 0).any() or not np.allclose(table.sum(axis=1), 1):
            raise SimError(
                "probabilities must be at least 0 and sum to 1 in every state"
                "; pass Policy.probabilities of a problem on this grid"
            )
        self._probabilities = table

    def begin(self, episode: int) -> None:
        """Start the random numbers of this episode."""
        self._rng = episode_rng(self._seed, episode, POLICY)

    def decide(self, observation: Observation) -> Action:
        """The policy's action in the robot's cell; WAIT outside the grid."""
        state = self._grid.state_at(observation.x_m, observation.y_m)
        if state < 0:
            return Action.WAIT
        row = self._probabilities[state]
        if self._greedy:
            return Action(int(np.argmax(row)))
        return Action(int(self._rng.choice(len(row), p=row / row.sum())))


def model_driver(path: str, scenario: Scenario, seed: int) -> PolicyDriver:
    """Drives by the optimal policy of a model, and where it is trapped by the way of least time.

    FileError where the model is for another grid.
    """
    grid = grid_of(scenario)
    problem, model = problem_of_model(path, load_model(path, expected_grid=grid), scenario, grid)
    names = tuple(each.name for each in model.outcome_models)
    if names != tuple(problem.model_names):
        raise SimError(
            f"{path}: outcome_models must be {', '.join(problem.model_names)}, "
            f"got {', '.join(names)}; learn the model again"
        )
    outcomes = model.outcome_probabilities
    draws = [np.array(table) for table in model.draws.learned] or [outcomes]
    n_periods = steps_within(scenario.episode_timeout_s, scenario.decision_period_s)

    def arrival_of(policy: Policy) -> ArrivalByState:
        return ArrivalByState.average(
            arrival_by_state(problem, policy.probabilities, table, n_periods) for table in draws
        )

    learned = optimal_policy(problem, model.weights, outcomes)
    driven = arriving_policy(problem, learned, outcomes, arrival_of, n_periods)
    return PolicyDriver(grid, driven.policy.probabilities, seed=seed, name=path)
