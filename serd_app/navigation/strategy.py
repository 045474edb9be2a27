"""The plan of a learned model in a scenario: policy, traps, predicted arrival and the way to go.

The policy is the learned one, but for the states in which that is trapped: there it is the way of
least expected time (`serd_core.arrival.arriving_policy`). All that is predicted is of this policy.

A model that was learned on another grid transfers its reward weights by feature name and its
outcome probabilities by model name; they mean the same only for cells and decision periods of the
same size. Grid, flow, walls and goal are the scenario's own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from serd_app.learning.crossing_times import leaving_outcomes
from serd_app.navigation.crossing_forecast import STEP_S, CrossingForecast
from serd_bag.errors import FileError
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.arrival.arriving_policy import ArrivingPolicy, arriving_policy
from serd_core.arrival.chain import (
    ArrivalByState,
    ArrivalTimes,
    arrival_by_state,
    arrival_time_distribution,
    policy_chain,
)
from serd_core.arrival.crossing_chain import crossing_moves
from serd_core.arrival.law import ArrivalLaw, law_in_seconds, steps_within
from serd_core.arrival.trap_states import Traps
from serd_core.bayes.draws import averaged_policy
from serd_core.grid.grid import Action, Outcome
from serd_core.grid.navigation import NavigationProblem
from serd_core.policies.solved_policy import Policy, optimal_policy, soft_policy
from serd_files.model_file import CrossingTimes, ModelFile, Probabilities, load_model, require_grid
from serd_sim.scenario.grid import grid_of, start_states_of
from serd_sim.scenario.model_problem import problem_of_model
from serd_sim.scenario.scenario import Scenario

SOLVERS = {"optimal": optimal_policy, "soft": soft_policy}
_OUTCOME_NAMES = tuple(outcome.name.lower() for outcome in Outcome)


@dataclass(frozen=True, eq=False)
class Strategy:
    """A solved model on the grid of a scenario.

    scenario: its goal area is the one planned for. learned: the policy of the learned rewards and
    dynamics in all states. outcome_probabilities: (M, K) in the problem's order; outcome_draws: (n,
    M, K) draws of their posterior, over which predictions are averaged, of one table without a
    posterior. entry_times_s: see `serd_core.arrival.law`. times: of drives with the look-ahead of
    this one, None to predict by decision periods. transferred: whether the model was learned on
    another grid.
    """

    scenario: Scenario
    problem: NavigationProblem
    learned: Policy
    file: ModelFile
    outcome_probabilities: FloatArray
    outcome_draws: FloatArray
    entry_times_s: tuple[float, ...]
    timeout_s: float
    transferred: bool = False
    times: CrossingTimes | None = None
    # The policy to drive is chosen by forecasts of several policies, each of which takes seconds.
    _forecasts: dict[Policy, CrossingForecast] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def driven(self) -> ArrivingPolicy:
        """The policy to drive, with its arrival, and what is trapped."""
        return arriving_policy(
            self.problem,
            self.learned,
            self.outcome_probabilities,
            self._arrival_of,
            self.n_steps,
        )

    @property
    def policy(self) -> Policy:
        """The learned policy, and where it is trapped the way of least expected time."""
        return self.driven.policy

    @property
    def by_time(self) -> BoolArray:
        """(S,) states in which the policy takes the way of least expected time."""
        return self.driven.by_time

    @property
    def traps(self) -> Traps:
        """The states from which neither the learned policy nor the way of least time arrives."""
        return self.driven.traps

    @property
    def arrival(self) -> ArrivalByState:
        """The remaining time from every state, up to the time-out, in steps of `step_s`."""
        return self.driven.arrival

    @property
    def n_periods(self) -> int:
        """Decision periods until the time-out."""
        return steps_within(self.timeout_s, self.scenario.decision_period_s)

    def predicted_arrival(self, start_distribution: FloatArray, n_periods: int) -> ArrivalTimes:
        """Distribution of the time of arrival from (S,) start probabilities."""
        problem, policy = self.problem, self.policy.probabilities
        return ArrivalTimes.average(
            [
                arrival_time_distribution(problem, policy, table, start_distribution, n_periods)
                for table in self.outcome_draws
            ]
        )

    def law_s(self, arrival: ArrivalTimes) -> ArrivalLaw:
        """An arrival counted in periods as a law in seconds, by the demonstrations' entry times."""
        period_s = self.scenario.decision_period_s
        return law_in_seconds(arrival, period_s=period_s, entry_times_s=self.entry_times_s)

    def law_from(self, start_distribution: FloatArray) -> ArrivalLaw:
        """Time of arrival (s) of an episode from (S,) start probabilities, up to the time-out."""
        if self.crossings is not None:
            return self.crossings.from_start(start_distribution)
        return self.law_s(self.predicted_arrival(start_distribution, self.n_periods))

    @property
    def crossings(self) -> CrossingForecast | None:
        """The prediction by crossing times; None where there are none."""
        return self._crossings_of(self.policy)

    def _crossings_of(self, policy: Policy) -> CrossingForecast | None:
        times = self.times
        if times is None:
            return None
        if policy not in self._forecasts:
            moves, *draws = (
                crossing_moves(
                    self.problem, policy.probabilities, leaving_outcomes(times, outcomes)
                )
                for outcomes in (self.outcome_draws.mean(axis=0), *self.outcome_draws)
            )
            n_people = self.scenario.pedestrians.count
            self._forecasts[policy] = CrossingForecast(
                self.problem, moves, tuple(draws), times, n_people, self.timeout_s
            )
        return self._forecasts[policy]

    def _arrival_of(self, policy: Policy) -> ArrivalByState:
        crossings = self._crossings_of(policy)
        if crossings is not None:
            return crossings.by_cell(policy.greedy)
        return ArrivalByState.average(
            arrival_by_state(self.problem, policy.probabilities, table, self.n_periods)
            for table in self.outcome_draws
        )

    def law_of_cell(self, state: int) -> ArrivalLaw:
        """The remaining time (s) of a robot in a cell, up to the time-out."""
        entry_s = () if self.crossings is not None else self.entry_times_s
        arrival = self.arrival.from_state(state)
        return law_in_seconds(arrival, period_s=self.step_s, entry_times_s=entry_s)

    @property
    def step_s(self) -> float:
        """Of `arrival`: the decision period, or that of crossing times."""
        return self.scenario.decision_period_s if self.times is None else STEP_S

    @property
    def n_steps(self) -> int:
        """Those steps until the time-out."""
        return steps_within(self.timeout_s, self.step_s)

    @cached_property
    def likeliest_next(self) -> IntArray:
        """(S,) the likeliest successor of the greedy action other than the state itself.

        The state itself where the action moves nowhere.
        """
        mdp = self.problem.mdp
        greedy = np.eye(mdp.n_actions)[self.policy.greedy]
        chain = policy_chain(mdp, greedy, self.outcome_probabilities)
        chain.setdiag(0.0)
        moves = np.asarray(chain.max(axis=1).todense()).ravel() > 0
        return np.where(moves, np.asarray(chain.argmax(axis=1)).ravel(), np.arange(mdp.n_states))

    def cell_ahead(self, state: int, action: Action, n_cells: int) -> int:
        """The cell to send a robot in `state` to: `n_cells` straight on by `action`, or fewer.

        Only cells on the likeliest way and short of the goal; round corners the direct way may be
        barred.
        """
        neighbours, goals = self.problem.grid.neighbours, self.problem.goal_states
        ahead = int(neighbours[state, action])
        for _ in range(n_cells - 1):
            straight_on = int(neighbours[ahead, action])
            likeliest = self.likeliest_next[ahead]
            if ahead in goals or straight_on == ahead or likeliest != straight_on:
                break
            ahead = straight_on
        return ahead

    def intended_path_m(self, state: int) -> FloatArray:
        """(N, 2) centres of the cells of the greedy policy, up to the goal or a repetition."""
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
    file: ModelFile | None = None,
    lookahead_cells: int = 1,
) -> Strategy:
    """Solve the model of a file on the scenario's own problem; FileError where it cannot be used.

    kind: "optimal" for the hard Bellman optimum of the learned rewards and dynamics, "soft" for
    the stochastic policy of the expert. transfer: whether to accept a model of another grid.
    timeout_s: the scenario's when None. file: the content of the file, read when None.
    lookahead_cells: how it is driven.
    """
    file = load_model(path) if file is None else file
    grid = grid_of(scenario)
    transferred = file.grid.fingerprint != grid.fingerprint()
    if transferred and not transfer:
        require_grid(path, file, grid)
    here = scenario.cell_size_m, scenario.decision_period_s
    require_same_scale(path, file, scenario.name, *here)
    problem, own = problem_of_model(path, file, scenario, grid, transferred=transferred)
    rows = tuple(each.learned for each in file.outcome_models)
    tables = (rows, *own.draws.learned)
    planned = np.array([outcome_probabilities_of(path, file, problem, each) for each in tables])
    probabilities, draws = planned[0], planned[1:] if own.draws.learned else planned
    policy = SOLVERS[kind](problem, own.weights, probabilities)
    if kind == "soft" and own.draws.learned:
        weights = np.array(own.draws.reward_weights)
        policy = replace(policy, probabilities=averaged_policy(problem, weights, draws))
    return Strategy(
        scenario=scenario,
        problem=problem,
        learned=policy,
        file=file,
        outcome_probabilities=probabilities,
        outcome_draws=draws,
        entry_times_s=file.goal_entry_s,
        timeout_s=scenario.episode_timeout_s if timeout_s is None else timeout_s,
        transferred=transferred,
        times=file.times_of(lookahead_cells),
    )


def start_distribution(scenario: Scenario, area: str) -> FloatArray:
    """(S,) uniform over the cells of a start area in which the robot starts."""
    grid = grid_of(scenario)
    states = start_states_of(scenario, grid, area)
    return np.bincount(states, minlength=grid.n_states) / len(states)


def require_same_scale(
    path: str | Path, file: ModelFile, where: str | Path, cell_size_m: float, period_s: float
) -> None:
    """FileError where cells or decision periods of `where` are not as long as the model's."""
    for what, unit, there, here in (
        ("cells", "m", file.grid.cell_size_m, cell_size_m),
        ("decision periods", "s", file.decision_period_s, period_s),
    ):
        if there != here:
            raise FileError(
                f"{path}: was learned with {what} of {there:g} {unit}, but {str(where)!r} has "
                f"{here:g} {unit}; its outcome probabilities hold for its own only: learn one here"
            )


def outcome_probabilities_of(
    path: str | Path, file: ModelFile, problem: NavigationProblem, table: Sequence[Probabilities]
) -> FloatArray:
    """(M, K) rows and columns by name. table: a row per outcome model of the file."""
    rows = {each.name: row for each, row in zip(file.outcome_models, table, strict=True)}
    for what, needed, there in (
        ("outcome_models", problem.model_names, rows),
        ("outcome_names", _OUTCOME_NAMES, file.outcome_names),
    ):
        missing = [name for name in needed if name not in there]
        if missing:
            raise FileError(
                f"{path}: {what} must have {', '.join(needed)}, but {missing[0]!r} is missing"
                "; learn the model again"
            )
    columns = [file.outcome_names.index(name) for name in _OUTCOME_NAMES]
    return np.array([[rows[name][column] for column in columns] for name in problem.model_names])
