"""One vector of reward weights from experts with several goals, each an MDP with a goal of its own.

    L(w) = sum over goals g of sum over decisions of g of log pi_g(a | s; w)

Every goal has absorbing states, transitions and features of its own, of the same names.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import Objective, Scaled, StepCallback
from serd_core.ascent.trust_region import NewtonAscent
from serd_core.checks import float_array, shown
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import observe
from serd_core.display import Record
from serd_core.errors import SerdError
from serd_core.learners.certificate import judged_weights
from serd_core.learners.start import (
    WITH_PRIOR,
    dynamics_or_estimate,
    reward_names,
    starting_parameters,
)
from serd_core.mdp.problem import Problem, require_problem
from serd_core.policies.solved_policy import MdcePolicy
from serd_core.posterior.beliefs import FixedBelief
from serd_core.posterior.coordinates import LogPosterior, feature_ranges, free_numbers
from serd_core.posterior.posterior import Posterior
from serd_core.priors.prior import UniformPrior
from serd_core.uncertainty.standard_errors import covariance_of


@dataclass(frozen=True, eq=False, repr=False)
class SharedRewards(Record):
    """Weights of highest likelihood over all goals.

    reward_weights: (F,); information: (F, F) observed; log_likelihoods: (G,) of each goal.
    """

    feature_names: tuple[str, ...]
    reward_weights: FloatArray
    information: FloatArray
    log_likelihoods: FloatArray
    n_decisions: int
    converged: bool
    message: str

    @property
    def standard_errors(self) -> FloatArray:
        """(F,) from the observed information; infinite where that is singular."""
        return np.asarray(np.sqrt(np.diag(covariance_of(self.information))))


def fit_several_goals(
    goals: Sequence[tuple[Problem, Decisions]],
    *,
    dynamics: FloatArray | None = None,
    initial_weights: FloatArray | None = None,
    on_step: StepCallback | None = None,
) -> SharedRewards:
    """Learn the reward weights that a soft expert has in common over several goals.

    goals: (problem, decisions) of each, with the same feature names.
    dynamics: (M, K) that all goals share; None where the transitions are known.
    initial_weights: (F,) to start from, None for 0; on_step: called after each step of the ascent.

    Returns `SharedRewards`: weights, their information and standard errors, convergence.

        shared = sc.fit_several_goals([(to_lift, drives_to_lift), (to_door, drives_to_door)])
    """
    names = _shared_names(goals)
    start = np.zeros(len(names))
    if initial_weights is not None:
        start = float_array("initial_weights", initial_weights, (len(names),))
    ranges = np.max([feature_ranges(problem) for problem, _ in goals], axis=0)
    each = [_log_likelihood(problem, decisions, dynamics) for problem, decisions in goals]
    objective = SumOverGoals(each)
    scaled = Scaled(objective, 1.0 / ranges)
    found = scaled.maximum(NewtonAscent(), start, on_step)
    of_weights = reward_names(goals[0][0])
    found, _ = judged_weights(scaled, found, scaled.scale, of_weights, WITH_PRIOR)
    weights = found.vector
    return SharedRewards(
        feature_names=names,
        reward_weights=weights,
        information=-objective.hessian(weights),
        log_likelihoods=np.array([goal.found(weights)[1].policy_log_likelihood for goal in each]),
        n_decisions=sum(len(decisions) for _, decisions in goals),
        converged=found.converged,
        message=found.message,
    )


@dataclass(frozen=True, eq=False)
class SumOverGoals(Objective):
    """The sum of the goals' log-likelihoods of choices; known transitions only add a constant."""

    goals: Sequence[LogPosterior]

    def evaluate(self, vector: FloatArray) -> tuple[float, FloatArray]:
        values = [goal.found(vector)[1].policy_log_likelihood for goal in self.goals]
        gradients = [goal.evaluate(vector)[1] for goal in self.goals]
        return float(sum(values)), np.sum(gradients, axis=0)

    def hessian(self, vector: FloatArray) -> FloatArray:
        return np.asarray(np.sum([goal.hessian(vector) for goal in self.goals], axis=0))


def _log_likelihood(
    problem: Problem, decisions: Decisions, dynamics: FloatArray | None
) -> LogPosterior:
    model, policy_model = problem.mdp.transitions, MdcePolicy()
    if dynamics is None and model.n_parameters:
        raise SerdError(
            f"dynamics must be given for a model with {model.n_parameters} parameters, got None;"
            " pass estimate_dynamics(problem, decisions) or the truth"
        )
    observations = observe(problem, decisions)
    known = dynamics_or_estimate(problem, decisions, dynamics)
    if decisions.hidden.any():
        raise SerdError(
            f"decisions must show their actions, got {int(decisions.hidden.sum())} without; use"
            " fit_mdce_serd for each goal"
        )
    zeros = np.zeros(len(problem.feature_names))
    at = starting_parameters(problem, policy_model, zeros, known, FixedBelief())
    posterior = Posterior(problem, observations, policy_model, UniformPrior())
    return LogPosterior(posterior, free_numbers(problem, FixedBelief(), at))


def _shared_names(goals: Sequence[tuple[Problem, Decisions]]) -> tuple[str, ...]:
    if not goals:
        raise SerdError("goals must be at least one, got none; pass (problem, decisions) pairs")
    for goal in goals:
        if not (isinstance(goal, tuple | list) and len(goal) == 2):
            raise SerdError(
                f"goals must list pairs (problem, decisions), got {shown(goal)}; pass [(problem,"
                " decisions)] for one"
            )
        require_problem(goal[0])
    names = goals[0][0].feature_names
    for number, (problem, _) in enumerate(goals):
        if problem.feature_names != names:
            raise SerdError(
                f"goals must share their features {names}, got {problem.feature_names} for goal"
                f" {number}; rename or reorder them"
            )
    return names
