"""The strategy's plan from a model file: policy, traps, predicted arrival and the way to go."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from serd_app.navigation.usable_model import usable_model
from serd_core.arrival.chain import (
    ArrivalByState,
    ArrivalTimes,
    arrival_by_state,
    arrival_time_distribution,
)
from serd_core.arrival.law import ArrivalLaw, law_in_seconds
from serd_core.arrival.trap_states import Traps, find_traps
from serd_core.grid.grid import Action
from serd_core.grid.navigation import NavigationProblem
from serd_core.policies.solved_policy import Policy, optimal_policy, soft_policy
from sim.scenario.grid import grid_of, start_states_of
from sim.scenario.scenario import Scenario
from storage.model_file import ModelFile

SOLVERS = {"optimal": optimal_policy, "soft": soft_policy}
#: A state that arrives in time with less than this is called a trap.
TRAP_PROBABILITY = 0.5


@dataclass(frozen=True, eq=False)
class Strategy:
    """A solved model on the grid of a scenario.

    scenario: its goal area is the one planned for. entry_times_s: see `serd_core.arrival.law`.
    transferred: whether the model was learned on another grid.
    """

    scenario: Scenario
    problem: NavigationProblem
    policy: Policy
    file: ModelFile
    outcome_probabilities: NDArray[np.float64]
    entry_times_s: tuple[float, ...]
    timeout_s: float
    transferred: bool = False

    @property
    def n_periods(self) -> int:
        """Decision periods until the time-out."""
        return math.ceil(self.timeout_s / self.scenario.decision_period_s - 1e-9)

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

    def law_s(self, arrival: ArrivalTimes) -> ArrivalLaw:
        """An arrival counted in periods as a law in seconds, by the demonstrations' entry times."""
        period_s = self.scenario.decision_period_s
        return law_in_seconds(arrival, period_s=period_s, entry_times_s=self.entry_times_s)

    @cached_property
    def arrival(self) -> ArrivalByState:
        """The remaining time from every state, up to the time-out."""
        return arrival_by_state(
            self.problem, self.policy.probabilities, self.outcome_probabilities, self.n_periods
        )

    @cached_property
    def traps(self) -> Traps:
        """Where the policy does not lead to the goal."""
        return find_traps(
            self.problem.grid.neighbours,
            self.policy.greedy,
            self.problem.goal_states,
            self.arrival.within(self.n_periods),
            TRAP_PROBABILITY,
        )

    def intended_path_m(self, state: int) -> NDArray[np.float64]:
        """(N, 2) centres of the cells the greedy policy means to cross, up to goal or a repeat."""
        grid, path = self.problem.grid, [state]
        while True:
            following = int(grid.neighbours[path[-1], self.policy.greedy[path[-1]]])
            if following in path:
                return np.asarray(grid.centers_m[path], dtype=np.float64)
            path.append(following)


def load_strategy(
    path: str,
    scenario: Scenario,
    kind: str,
    *,
    transfer: bool = False,
    timeout_s: float | None = None,
    read: ModelFile | None = None,
) -> Strategy:
    """Solve the model of a file; FileError where it cannot be used in the scenario.

    kind: "optimal" for the hard Bellman optimum of the learned rewards and dynamics, "soft" for
    the expert's own stochastic policy. timeout_s: the scenario's when None. read: what the file
    held when it was read before, to plan for another goal.
    """
    model = usable_model(path, scenario, transfer=transfer, model=read)
    probabilities = model.outcome_probabilities
    return Strategy(
        scenario=scenario,
        problem=model.problem,
        policy=SOLVERS[kind](model.problem, model.file.weights, probabilities),
        file=model.file,
        outcome_probabilities=probabilities,
        entry_times_s=model.file.goal_entry_s,
        timeout_s=scenario.episode_timeout_s if timeout_s is None else timeout_s,
        transferred=model.transferred,
    )


def start_distribution(scenario: Scenario, area: str) -> NDArray[np.float64]:
    """(S,) uniform over the cells of a start area in which the robot starts."""
    grid = grid_of(scenario)
    states = start_states_of(scenario, grid, area)
    return np.bincount(states, minlength=grid.n_states) / len(states)


def arrows_of(policy: Policy) -> list[Action]:
    """The greedy action of each state."""
    return [Action(int(action)) for action in policy.greedy]
