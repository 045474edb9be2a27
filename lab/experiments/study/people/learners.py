"""What learns from the decisions of a fold, or does not, and what each predicts.

SERD takes the cell that a decision led to as what it was for, and learns rewards, outcomes and laws
of dwell times together. With hidden actions it learns from cells alone, and laws are counted. IRL
counts outcomes and laws before it learns rewards. Laws differ by place where episodes that were
left out support that.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse

from lab.experiments.study.people.place import Place
from serd_app.learning.recipe import dynamics_of, with_moves_as_actions
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.chain import (
    ArrivalByState,
    RenewalChain,
    policy_chain,
    renewal_arrival,
    timed_arrival,
)
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.grid.grid import Action
from serd_core.grid.navigation import NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood
from serd_core.learners.serd import fit_mdce_serd
from serd_core.policies.solved_policy import soft_policy
from serd_core.semi_markov.models import require_timed, semi_markov_problem

SERD, HIDDEN_ACTIONS, IRL, COUNT = "SERD", "SERD, hidden actions", "IRL", "counts"


@dataclass(frozen=True, eq=False)
class Task:
    """decisions: of the people learned from, with hidden actions; times_s: (T,) even steps from 0.

    problem: among the flow of these people.
    """

    place: Place
    problem: NavigationProblem
    decisions: TimedDecisions
    times_s: FloatArray

    @property
    def shown(self) -> TimedDecisions:
        """The decisions with the cell that each led to as its action."""
        return with_moves_as_actions(self.problem.grid, self.decisions)


@dataclass(frozen=True, eq=False)
class Prediction:
    """chain: (S, S) probability of the next state; arrival: by the times of the task.

    record: numbers that describe what was learned.
    """

    chain: scipy.sparse.csr_array
    arrival: ArrivalByState
    record: dict[str, object] = field(default_factory=dict)


def _of_fit(
    task: Task, fitted: NavigationProblem, fit: FitResult, decisions: TimedDecisions
) -> Prediction:
    """By the policy of the problem that was fitted, and laws of dwell times of the decisions."""
    table = fitted.mdp.transitions.local_probabilities(fit.parameters.truth)
    policy = soft_policy(fitted, fit.reward_weights, table).probabilities
    dynamics = dynamics_of(task.problem, decisions, fit, None)[0]
    problem, theta = semi_markov_problem(task.problem, log_pace=dynamics.log_pace), dynamics.truth
    model = require_timed(problem.mdp.transitions)
    record = {
        "converged": bool(fit.converged),
        "weights": dict(zip(fit.feature_names, fit.reward_weights.tolist(), strict=True)),
        "mean_s": np.exp(theta[model.means]).tolist(),
        "shape": np.exp(theta[model.shapes]).tolist(),
        "places": bool(np.any(dynamics.log_pace)),
    }
    outcomes = model.outcomes.local_probabilities(theta)
    chain = policy_chain(problem.by_decisions.mdp, policy, outcomes)
    arrival = timed_arrival(problem, policy, theta, task.times_s[1], len(task.times_s) - 1)
    return Prediction(chain, arrival, record)


def serd(task: Task) -> Prediction:
    """Rewards, outcomes and laws together."""
    fit = fit_mdce_serd(task.problem, task.shown)
    return _of_fit(task, task.problem, fit, task.shown)


def serd_of_hidden_actions(task: Task) -> Prediction:
    """Rewards and outcomes from cells alone, laws counted."""
    fitted = task.problem.by_decisions
    fit = fit_mdce_serd(fitted, task.decisions)
    return _of_fit(task, fitted, fit, task.decisions)


def irl(task: Task) -> Prediction:
    """Rewards of highest posterior under dynamics that are counted first."""
    fit = fit_mdce_irl_by_likelihood(task.problem, task.shown, prior=PriorByEvidence())
    return _of_fit(task, task.problem, fit, task.shown)


def counts(task: Task) -> Prediction:
    """Next cells by the part of the corridor, and dwell times by the direction: no fit.

    To the shares of each part, and to the times of each direction, those of all decisions are
    added with the weight of one.
    """
    near, seen = task.problem.grid.neighbours, task.decisions.select(~task.decisions.censored)
    towards = np.argmax(near[seen.state] == seen.next_state[:, None], axis=1)
    steps = np.maximum(np.rint(seen.dwell_s / task.times_s[1]).astype(np.int64), 1)
    times = np.zeros((near.shape[1], steps.max() + 1))
    np.add.at(times, (towards, steps), 1.0)
    mass = times + times.sum(axis=0) / len(seen)
    chain = RenewalChain(
        state=np.repeat(np.arange(len(near)), near.shape[1]),
        successor=near.ravel(),
        probability=_counted_shares(task, seen.state, towards).ravel(),
        dwell=np.tile(np.arange(near.shape[1]), len(near)),
        goal=np.isin(np.arange(len(near)), task.problem.goal_states),
    )
    arrival = renewal_arrival(chain, mass / mass.sum(axis=1, keepdims=True), len(task.times_s) - 1)
    return Prediction(chain.matrix().tocsr(), arrival)


def _counted_shares(task: Task, state: IntArray, towards: IntArray) -> FloatArray:
    """(S, 5) share of staying and of each direction, from (N,) of both that were seen."""
    near = task.problem.grid.neighbours
    by_cell = np.zeros(near.shape)
    np.add.at(by_cell, (state, towards), 1.0)
    share = task.place.by_part(by_cell)[task.place.part] + by_cell.sum(axis=0) / len(state)
    possible = near != np.arange(len(near))[:, None]
    possible[:, Action.WAIT] = True
    share *= possible
    share[task.problem.goal_states] = np.arange(near.shape[1]) == Action.WAIT
    return np.asarray(share / share.sum(axis=1, keepdims=True))


LEARNERS: Mapping[str, Callable[[Task], Prediction]] = {
    SERD: serd,
    HIDDEN_ACTIONS: serd_of_hidden_actions,
    IRL: irl,
    COUNT: counts,
}
