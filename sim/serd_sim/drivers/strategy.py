"""The plan of a learned model in a scenario: policy, traps, predicted arrival and the way to go.

The robot plans with the posterior mean of K = P E[gamma^tau], in which Bellman's equation is linear
(docs/semi_markov.md), or with a quantile over its draws. Where the learned policy is trapped it
takes the way of least expected time (`serd_core.arrival.arriving_policy`). All that is predicted is
of this policy.

A model that was learned on another grid transfers its reward weights by feature name and its local
models by their names; they mean the same only for cells of the same size. Grid, flow, walls, goal,
patience and the length of a wait are the scenario's own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from serd_bag.errors import FileError
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.arrival.arriving_policy import (
    TRAP_PROBABILITY,
    ArrivingPolicy,
    Traps,
    arriving_policy,
    likely_by_moments,
)
from serd_core.arrival.chain import ArrivalByState, arrival_moments, timed_arrival
from serd_core.arrival.law import ArrivalLaw, steps_within
from serd_core.bayes.laplace import averaged_policy
from serd_core.errors import SerdError
from serd_core.grid.grid import Grid, Outcome
from serd_core.grid.navigation import NO_FLOW, NavigationProblem, features_of_flow, with_dwell_times
from serd_core.policies.pessimistic_policy import pessimistic_policy
from serd_core.policies.solved_policy import Policy, optimal_policy, soft_policy
from serd_core.semi_markov.models import require_timed
from serd_files.model_file import ModelFile, Probabilities, load_model, require_grid
from serd_sim.scenario.grid import flow_of, grid_of, navigation_problem_of, start_states_of
from serd_sim.scenario.scenario import Scenario

SOLVERS = {"optimal": optimal_policy, "soft": soft_policy}
#: Seconds between the times for which arrivals are predicted.
STEP_S = 0.1
#: Draws over which a prediction is averaged; every one takes the solution of a chain.
MOST_DRAWS = 12
_OUTCOME_NAMES = tuple(outcome.name.lower() for outcome in Outcome)


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan:
    """The way to go by a learned policy, and its arrival.

    problem: its decisions take time. learned: the policy of the learned rewards and dynamics in all
    states. draws: (n, N) of the dynamics, over which predictions are averaged; the learned ones
    alone without a posterior.
    """

    problem: NavigationProblem
    learned: Policy
    draws: FloatArray
    timeout_s: float
    _arrivals: dict[Policy, tuple[ArrivalByState, ...]] = field(
        default_factory=dict, init=False, repr=False
    )

    @cached_property
    def driven(self) -> ArrivingPolicy:
        """The policy to drive, and what is trapped."""
        model = require_timed(self.problem.mdp.transitions)
        return arriving_policy(
            self.problem,
            self.learned,
            model.outcomes.local_probabilities(self.draws).mean(axis=0),
            np.mean([model.expected_seconds(each) for each in self.draws], axis=0),
            self._likely,
        )

    @cached_property
    def mean_s(self) -> FloatArray:
        """(S,) mean remaining time; that of the time until the time-out where none is certain."""
        mean_s, _ = self._moments(self.policy)
        if np.isfinite(mean_s).all():
            return mean_s
        return np.where(np.isfinite(mean_s), mean_s, STEP_S * self.arrival.mean_steps)

    def _moments(self, policy: Policy) -> tuple[FloatArray, FloatArray]:
        """(S,) mean and (S,) mean square of the remaining time over the draws."""
        chains, chosen = self.draws[:MOST_DRAWS], policy.probabilities
        moments = [arrival_moments(self.problem, chosen, each, STEP_S) for each in chains]
        mean_s, square_s2 = np.mean(moments, axis=0)
        return np.asarray(mean_s), np.asarray(square_s2)

    def _likely(self, policy: Policy) -> BoolArray:
        """(S,) where a policy arrives before the time-out; by the law where moments leave it open.

        The law of a large map takes a hundred times as long.
        """
        found = likely_by_moments(*self._moments(policy), STEP_S * self.n_steps)
        if found.all():
            return found
        law = ArrivalByState.average(self.arrival_of_draws(policy))
        return np.asarray(law.within(self.n_steps) >= TRAP_PROBABILITY)

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
    def has_law(self) -> bool:
        """Whether `arrival` is known; on a large map it takes seconds."""
        return "arrival" in self.__dict__

    @cached_property
    def arrival(self) -> ArrivalByState:
        """The remaining time from every state, up to the time-out, in steps of `STEP_S`."""
        return ArrivalByState.average(self.arrival_of_draws(self.policy))

    @property
    def n_steps(self) -> int:
        """Those steps until the time-out."""
        return steps_within(self.timeout_s, STEP_S)

    def law_from(self, start_distribution: FloatArray) -> ArrivalLaw:
        """Time of arrival (s) of an episode from (S,) start probabilities, up to the time-out."""
        each = self.arrival_of_draws(self.policy)
        cdf = np.stack([arrival.cdf @ start_distribution for arrival in each])
        ever = [arrival.arrival_probability @ start_distribution for arrival in each]
        return ArrivalLaw(self._times_s, cdf.mean(axis=0), float(np.mean(ever)), cdf)

    def law_of_cell(self, state: int) -> ArrivalLaw:
        """The remaining time (s) of a robot that decides in a cell, up to the time-out."""
        ever = float(self.arrival.arrival_probability[state])
        return ArrivalLaw(self._times_s, self.arrival.cdf[:, state], ever)

    @property
    def _times_s(self) -> FloatArray:
        return np.asarray(STEP_S * np.arange(self.n_steps + 1), dtype=np.float64)

    def arrival_of_draws(self, policy: Policy) -> tuple[ArrivalByState, ...]:
        """The arrival by a policy from every state, for each of the first draws."""
        if policy not in self._arrivals:
            self._arrivals[policy] = tuple(
                timed_arrival(self.problem, policy.probabilities, each, STEP_S, self.n_steps)
                for each in self.draws[:MOST_DRAWS]
            )
        return self._arrivals[policy]

    def intended_path(self, state: int) -> IntArray:
        """(N,) the cells of the greedy policy from one on, up to the goal or a repetition."""
        grid, path = self.problem.grid, [state]
        goals = set(self.problem.goal_states.tolist())
        while path[-1] not in goals:
            following = int(grid.neighbours[path[-1], self.policy.greedy[path[-1]]])
            if following in path:
                break
            path.append(following)
        return np.array(path)

    def leads_to_goal(self, state: int) -> bool:
        """Whether the intended path of a cell ends in the goal."""
        return bool(np.isin(self.intended_path(state)[-1], self.problem.goal_states))

    def intended_path_m(self, state: int) -> FloatArray:
        """(N, 2) the centres of these cells."""
        return np.asarray(self.problem.grid.centers_m[self.intended_path(state)], dtype=np.float64)


@dataclass(frozen=True, eq=False, kw_only=True)
class Strategy(Plan):
    """A solved model on the grid of a scenario.

    scenario: its goal area is the one planned for. transferred: whether the model was learned on
    another grid.
    """

    scenario: Scenario
    file: ModelFile
    transferred: bool = False


def load_strategy(
    path: str,
    scenario: Scenario,
    kind: str,
    *,
    plan_quantile: float = 0.0,
    transfer: bool = False,
    timeout_s: float | None = None,
    file: ModelFile | None = None,
) -> Strategy:
    """Solve the model of a file on the scenario's own problem; FileError where it cannot be used.

    kind: "optimal" for the hard Bellman optimum of the learned rewards and dynamics, "soft" for
    the stochastic policy of the expert. plan_quantile: of an optimal plan over the draws of the
    posterior, 0 for their mean. transfer: whether to accept a model of another grid.
    timeout_s: the scenario's when None. file: the content of the file, read when None.
    """
    file = load_model(path) if file is None else file
    grid = grid_of(scenario)
    transferred = file.grid.fingerprint != grid.fingerprint()
    if transferred and not transfer:
        require_grid(path, file, grid)
    if file.grid.cell_size_m != scenario.cell_size_m:
        raise FileError(
            f"{path}: was learned with cells of {file.grid.cell_size_m:g} m, but {scenario.name!r}"
            f" has {scenario.cell_size_m:g} m; what it knows of a move holds for its own only:"
            " learn one here"
        )
    problem, own = problem_of_model(path, file, scenario, grid, transferred=transferred)
    draws = dynamics_of_draws(path, own, problem)
    tables = require_timed(problem.mdp.transitions).local_probabilities(draws)
    if plan_quantile:
        _require_draws(path, kind, own)
        policy = pessimistic_policy(problem, own.weights, tables, plan_quantile)
    else:
        policy = SOLVERS[kind](problem, own.weights, tables.mean(axis=0))
    if kind == "soft" and own.draws.learned:
        weights = np.array(own.draws.reward_weights)
        policy = replace(policy, probabilities=averaged_policy(problem, weights, tables))
    return Strategy(
        scenario=scenario,
        problem=problem,
        learned=policy,
        file=file,
        draws=draws,
        timeout_s=scenario.episode_timeout_s if timeout_s is None else timeout_s,
        transferred=transferred,
    )


def _require_draws(path: str, kind: str, file: ModelFile) -> None:
    """FileError unless a plan by a quantile is one of rewards, over draws of a posterior."""
    if kind != "optimal":
        raise FileError(
            f"plan_quantile must be 0 for the policy {kind!r}, the expert's, got more; choose"
            " optimal"
        )
    if not file.draws.learned:
        raise FileError(
            f"{path}: plan_quantile needs draws of the posterior, but it has none; learn the model"
            " by SERD with priors by evidence"
        )


def problem_of_model(
    path: str, file: ModelFile, scenario: Scenario, grid: Grid, *, transferred: bool = False
) -> tuple[NavigationProblem, ModelFile]:
    """The problem to plan in, whose decisions take time, and the model with its features alone.

    transferred: whether the model was learned on another grid, so that its flow is not that of this
    one. FileError where the file has an unknown feature.
    """
    own_flow = None if transferred else file.flow_on(path, grid)
    flow = flow_of(scenario, grid) if own_flow is None else own_flow
    known, own = model_in_flow(file, flow), file.own_features
    if transferred and own:
        known, own = known.with_features([n for n in known.feature_names if n not in own]), {}
    try:
        problem = navigation_problem_of(scenario, file.discount, known.feature_names, flow, own)
        pace = np.log(file.pace) if file.pace and not transferred else None
        timed = with_dwell_times(
            problem, patience_s=scenario.patience_s, wait_s=scenario.wait_s, log_pace=pace
        )
    except SerdError as error:
        raise FileError(f"{path}: {error}; learn the model again") from None
    return timed, known


def model_in_flow(file: ModelFile, flow: IntArray) -> ModelFile:
    """The model with the weights that count in a place with a flow (S,).

    That of the social norm does not where no people walk, as the place has no such feature. Models
    that older versions learned in such a place have one too, which is the weight of waiting.
    """
    learned_in = np.full_like(flow, NO_FLOW) if file.without_flow else flow
    return file.with_features(features_of_flow(learned_in, file.feature_names))


def dynamics_of_draws(path: str | Path, file: ModelFile, problem: NavigationProblem) -> FloatArray:
    """(n, N) draws of a file's dynamics on a problem; the learned ones where it has no draws."""
    if not file.draws.learned:
        return learned_dynamics(path, file, problem)[None, :]
    kept = file.draws
    rows = zip(kept.learned, kept.mean_s, kept.shape, strict=True)
    return np.stack([_parameters(path, file, problem, *row) for row in rows])


def learned_dynamics(
    path: str | Path, file: ModelFile, problem: NavigationProblem, *, believed: bool = False
) -> FloatArray:
    """(N,) parameters of the learned dynamics of a file, or of what the expert believed."""
    rows = file.outcome_models
    timed = [each for each in rows if each.shape]
    return _parameters(
        path,
        file,
        problem,
        tuple(each.believed if believed else each.learned for each in rows),
        tuple(each.believed_mean_s if believed else each.mean_s for each in timed),
        tuple(each.shape or 0.0 for each in timed),
    )


def _parameters(
    path: str | Path,
    file: ModelFile,
    problem: NavigationProblem,
    outcomes: Sequence[Probabilities],
    mean_s: Sequence[float],
    shape: Sequence[float],
) -> FloatArray:
    """mean_s, shape: of the outcome models that have a shape."""
    model, names = require_timed(problem.mdp.transitions), [m.name for m in file.outcome_models]
    timed = [each.name for each in file.outcome_models if each.shape]
    laws = [
        name for name, law in zip(problem.model_names, model.law_of, strict=True) if law[0] >= 0
    ]
    for what, needed, there in (
        ("outcome_models", problem.model_names, names),
        ("outcome_models with a shape", laws, timed),
        ("outcome_names", _OUTCOME_NAMES, file.outcome_names),
    ):
        missing = [name for name in needed if name not in there]
        if missing:
            raise FileError(
                f"{path}: {what} must have {', '.join(needed)}, but {missing[0]!r} is missing"
                "; learn the model again"
            )
    columns = [file.outcome_names.index(name) for name in _OUTCOME_NAMES]
    table = np.array(outcomes)[[names.index(name) for name in problem.model_names]][:, columns]
    of_law = [timed.index(name) for name in laws]
    return model.parameters_from(table, np.array(mean_s)[of_law], np.array(shape)[of_law])


def start_distribution(scenario: Scenario, area: str) -> FloatArray:
    """(S,) uniform over the cells of a start area in which the robot starts."""
    grid = grid_of(scenario)
    states = start_states_of(scenario, grid, area)
    return np.bincount(states, minlength=grid.n_states) / len(states)
