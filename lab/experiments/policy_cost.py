"""What a gradient costs: Table 4.2, measured, and the adjoint beside it.

The thesis states O(N (S A)^3) for its Q-gradient by LU, O(N (S A)^2) for one step of the soft
iteration and O(N A S^2) for one step of the hard one, for dense transitions. Each is built here as
stated (dense, one parameter after the other) and timed over a ladder of sizes; so is the adjoint of
this library (sparse, all parameters at once). Fitted exponents stand beside the stated ones.

One LU factor serves all parameters, so by LU the cost is really O((S A)^3 + N (S A)^2).
"""

import time
import timeit
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import numpy as np
import pandas as pd
from pydantic import Field

from lab.experiments.running.experiment import Count, Findings, SeededConfig, Session
from lab.experiments.running.tables import Row
from serd_core.arrays import FloatArray
from serd_core.bellman.bellman_solver import BellmanSolution, SoftBellman, adjoint
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import Transitions, transitions_of
from serd_core.mdp.mdp import Mdp
from serd_files.settings import setting

#: Stated exponents of Table 4.2 by quantity; the adjoint's are this library's claim.
STATED: dict[str, dict[str, float]] = {
    "LU": {"n_states": 3, "n_actions": 3, "n_parameters": 1},
    "soft step": {"n_states": 2, "n_actions": 2, "n_parameters": 1},
    "hard step": {"n_states": 2, "n_actions": 1, "n_parameters": 1},
    "adjoint": {"n_states": 1, "n_actions": 1, "n_parameters": 0},
}


Ladder = Annotated[tuple[Count, ...], Field(min_length=2)]


class PolicyCostConfig(SeededConfig):
    """Ladders of sizes: one quantity grows, the others stay at their base."""

    base: tuple[Count, Count, Count] = setting(
        (100, 4, 4), "states, actions and parameters that stay"
    )
    n_states: Ladder = setting((100, 200, 400), "sizes while only the states grow")
    n_actions: Ladder = setting((4, 8, 16), "sizes while only the actions grow")
    n_parameters: Ladder = setting((4, 8, 16, 32), "sizes while only the parameters grow")
    repeats: Count = setting(5, "runs of each, of which the fastest counts")


@dataclass(frozen=True, eq=False)
class CostCase:
    """A problem with all arrays in the form each method takes.

    dense: (S*A, S) P; chain: (S*A, S*A) P(s'|s,a) pi(a'|s'); immediate: (S*A, N).
    """

    mdp: Mdp
    transitions: Transitions
    solution: BellmanSolution
    dense: FloatArray
    chain: FloatArray
    immediate: FloatArray


def run_policy_cost(config: PolicyCostConfig, session: Session) -> Findings:
    """Seconds of each method, and the exponents; one after the other for the timing."""
    table = measure_policy_cost(config, time.perf_counter)
    exponents = fitted_exponents(table)
    session.progress(1, 1)
    files = {"seconds.csv": table, "exponents.csv": exponents}
    return Findings(exponents, files)


def measure_policy_cost(config: PolicyCostConfig, timer: Callable[[], float]) -> pd.DataFrame:
    """One row per ladder step and method: least seconds of the repeats."""
    rows: list[Row] = []
    for varied, sizes in _ladders(config):
        for n_states, n_actions, n_parameters in sizes:
            rng = np.random.default_rng([config.seed, n_states, n_actions, n_parameters])
            case = cost_case(n_states, n_actions, n_parameters, rng)
            place: Row = {"varied": varied, "n_states": n_states, "n_actions": n_actions}
            place["n_parameters"] = n_parameters
            for method, run in METHODS.items():
                timed = timeit.Timer(partial(run, case), timer=timer)
                seconds = min(timed.repeat(config.repeats, number=1))
                rows.append(place | {"method": method, "seconds": seconds})
    return pd.DataFrame(rows)


def fitted_exponents(table: pd.DataFrame) -> pd.DataFrame:
    """Slope of log seconds over log size for each method and ladder, beside the stated one."""
    rows: list[Row] = []
    for method, stated in STATED.items():
        for varied, exponent in stated.items():
            ladder = _ladder(table, method, varied)
            slope = float(np.polyfit(np.log(ladder[varied]), np.log(ladder["seconds"]), 1)[0])
            rows.append({"method": method, "varied": varied, "fitted": slope, "stated": exponent})
    return pd.DataFrame(rows)


def cost_case(
    n_states: int, n_actions: int, n_parameters: int, rng: np.random.Generator
) -> CostCase:
    """Local dynamics as on a grid bent to a torus, and a random policy."""
    width = int(np.sqrt(n_states))
    nearby = np.arange(n_states)[:, None] + np.array([0, 1, width, -1, -width])
    models = OutcomeModels(
        np.repeat((nearby % n_states)[:, None, :], n_actions, axis=1),
        rng.integers(4, size=(n_states, n_actions)),
        np.ones((n_states, n_actions), np.bool_),
        n_models=4,
    )
    mdp = Mdp(models, 0.9)
    transitions = transitions_of(models, rng.dirichlet(np.ones(5), size=4))
    policy = rng.dirichlet(np.ones(n_actions), size=n_states)
    value = rng.normal(size=n_states)
    solution = BellmanSolution(value, np.log(policy), SoftBellman(), 1, 0, 0.0, 0.0, converged=True)
    immediate = rng.normal(size=(n_states * n_actions, n_parameters))
    mdp.transitions.policy_pattern  # noqa: B018  set up once per MDP, not timed
    dense = transitions.matrix.toarray()
    chain = (dense[:, :, None] * policy[None]).reshape(len(dense), -1)
    return CostCase(mdp, transitions, solution, dense, chain, immediate)


def by_lu(case: CostCase) -> FloatArray:
    """Q-gradient of each parameter by a dense LU of its own, as Table 4.2 counts it."""
    n_pairs = len(case.immediate)
    system = np.eye(n_pairs) - case.mdp.discount * case.chain
    columns = [np.linalg.solve(system, column) for column in case.immediate.T]
    return np.stack(columns, axis=1)


def soft_step(case: CostCase) -> FloatArray:
    """One application of (4.21) with the dense (S A) x (S A) matrix."""
    columns = [column + case.mdp.discount * (case.chain @ column) for column in case.immediate.T]
    return np.stack(columns, axis=1)


def hard_step(case: CostCase) -> FloatArray:
    """One application of (4.66): only the greedy action's gradient is propagated."""
    n_states, n_actions = case.mdp.n_states, case.mdp.n_actions
    greedy = np.arange(n_states) * n_actions + case.solution.q.argmax(axis=1)
    columns = [
        column + case.mdp.discount * (case.dense @ column[greedy]) for column in case.immediate.T
    ]
    return np.stack(columns, axis=1)


def by_adjoint(case: CostCase) -> FloatArray:
    """Gradient of one objective by all parameters, from one sparse factor."""
    shape = (case.mdp.n_states, case.mdp.n_actions)
    by_q = case.immediate[:, 0].reshape(shape)
    found = adjoint(case.mdp, case.transitions, case.solution, by_q)
    features = case.immediate.reshape(*shape, -1)
    return np.asarray(np.tensordot(found.reward_gradient, features, axes=2))


METHODS: dict[str, Callable[[CostCase], FloatArray]] = {
    "LU": by_lu,
    "soft step": soft_step,
    "hard step": hard_step,
    "adjoint": by_adjoint,
}


def _ladders(config: PolicyCostConfig) -> list[tuple[str, list[tuple[int, int, int]]]]:
    states, actions, parameters = config.base
    return [
        ("n_states", [(size, actions, parameters) for size in config.n_states]),
        ("n_actions", [(states, size, parameters) for size in config.n_actions]),
        ("n_parameters", [(states, actions, size) for size in config.n_parameters]),
    ]


def _ladder(table: pd.DataFrame, method: str, varied: str) -> pd.DataFrame:
    return table[(table["method"] == method) & (table["varied"] == varied)]
