"""The strategy's plan from a model file: policy, predicted arrival and the way it means to go."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from serd_core.arrival import ArrivalTimes, arrival_time_distribution
from serd_core.grid import Action
from serd_core.navigation import NavigationProblem
from serd_core.policies.solved_policy import Policy, optimal_policy, soft_policy
from sim.scenario import Scenario
from sim.scenario_grid import grid_of, navigation_problem_of, start_states_of
from storage.errors import FileError
from storage.model_file import ModelFile, load_model

SOLVERS = {"optimal": optimal_policy, "soft": soft_policy}


@dataclass(frozen=True, eq=False)
class Strategy:
    """A solved model on the grid of a scenario."""

    problem: NavigationProblem
    policy: Policy
    outcome_probabilities: NDArray[np.float64]

    def predicted_arrival(
        self, start_distribution: NDArray[np.float64], n_periods: int
    ) -> ArrivalTimes:
        """Distribution of the time of arrival from (S,) start probabilities."""
        return arrival_time_distribution(
            self.problem,
            self.policy.probabilities,
            self.outcome_probabilities,
            start_distribution,
            n_periods,
        )

    def intended_path_m(self, state: int) -> NDArray[np.float64]:
        """(N, 2) centres of the cells the greedy policy means to cross, up to goal or a repeat."""
        grid, path = self.problem.grid, [state]
        while True:
            following = int(grid.neighbours[path[-1], self.policy.greedy[path[-1]]])
            if following in path:
                return np.asarray(grid.centers_m[path], dtype=np.float64)
            path.append(following)


def load_strategy(path: str, scenario: Scenario, kind: str) -> Strategy:
    """Solve the model of a file; FileError where it belongs to another grid or other features.

    kind: "optimal" for the hard Bellman optimum of the learned rewards and dynamics, "soft" for
    the expert's own stochastic policy.
    """
    model = load_model(path, expected_grid=grid_of(scenario))
    problem = navigation_problem_of(scenario, model.discount, model.feature_names)
    _require_models(path, model, problem)
    probabilities = model.outcome_probabilities
    policy = SOLVERS[kind](problem, model.weights, probabilities)
    return Strategy(problem, policy, probabilities)


def start_distribution(scenario: Scenario, area: str) -> NDArray[np.float64]:
    """(S,) uniform over the cells of a start area."""
    grid = grid_of(scenario)
    states = start_states_of(scenario, grid, area)
    return np.bincount(states, minlength=grid.n_states) / len(states)


def arrows_of(policy: Policy) -> list[Action]:
    """The greedy action of each state."""
    return [Action(int(action)) for action in policy.greedy]


def _require_models(path: str, model: ModelFile, problem: NavigationProblem) -> None:
    names = tuple(each.name for each in model.outcome_models)
    if names != tuple(problem.model_names):
        raise FileError(
            f"{path}: outcome_models must be {', '.join(problem.model_names)}, "
            f"got {', '.join(names)}; learn the model again"
        )
