"""Where a fit starts: line 3 of Algorithm 1, and the reward weights of section 4.6.2.

`RewardSearch` is what learners of rewards alone share: dynamics taken as known, and their result.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import (
    Ascent,
    AscentResult,
    FunctionObjective,
    Objective,
    Scaled,
    StepCallback,
)
from serd_core.bellman.bellman_solver import BellmanSolution
from serd_core.checks import float_array, number_array, require_generator, require_kind
from serd_core.demonstrations.decisions import Decisions, require_shown
from serd_core.demonstrations.observations import Observations, observe
from serd_core.dynamics.estimation import estimate_dynamics, outcome_models_of
from serd_core.dynamics.transition_model import Transitions, transitions_of
from serd_core.errors import SerdError
from serd_core.learners.certificate import judged_weights
from serd_core.learners.fit_result import Assumptions, FitResult, fit_result
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import PolicyModel, solution_at
from serd_core.posterior.beliefs import Belief, FixedBelief, TiedBelief
from serd_core.posterior.coordinates import feature_ranges
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior
from serd_core.priors.prior import UniformPrior

TIED = TiedBelief()
#: Probability of intended outcomes where a fit of hidden actions starts.
INTENDED_SHARE = 0.9


def dynamics_or_estimate(
    problem: Problem, decisions: Decisions, dynamics: FloatArray | None, *, learned: bool = False
) -> FloatArray:
    """The given dynamics, or the M-estimate with a uniform prior (line 3 of Algorithm 1)."""
    model = problem.mdp.transitions
    if dynamics is None and model.n_parameters and decisions.hidden.any():
        if not learned:
            raise SerdError(
                f"action[{np.argmax(decisions.hidden)}] must be known for an estimate of the"
                " dynamics, got a hidden one; pass dynamics, or use a belief that learns them"
            )
        return dynamics_of_hidden_actions(problem, decisions)
    if dynamics is None:
        return estimate_dynamics(problem, decisions) if model.n_parameters else np.zeros(0)
    return np.asarray(number_array("dynamics", dynamics), dtype=np.float64)


def dynamics_of_hidden_actions(problem: Problem, decisions: Decisions) -> FloatArray:
    """(M, K) where a fit of hidden actions starts: the intended outcome of each model is likely."""
    model, shown = outcome_models_of(problem.mdp), decisions.select(~decisions.hidden)
    if model.intended is None and not len(shown):
        raise SerdError(
            "dynamics must be given as a start where all actions are hidden, got None; pass a table"
            " in which the intended outcomes are the most likely, or OutcomeModels with `intended`"
        )
    if model.intended is None:
        return estimate_dynamics(problem, shown)
    other = (1.0 - INTENDED_SHARE) / max(model.n_outcomes - 1, 1)
    table = np.full((model.n_models, model.n_outcomes), other)
    table[np.arange(model.n_models), model.intended] = INTENDED_SHARE
    table /= table.sum(axis=1, keepdims=True)
    if len(shown):
        estimate = estimate_dynamics(problem, shown)
        counted = np.unique(model.model_of[shown.state, shown.action])
        table[counted] = estimate[counted]
    return table


def initial_weights_or_sample(
    problem: Problem, initial_weights: FloatArray | None, rng: np.random.Generator | None
) -> FloatArray:
    """The given (F,) weights, or a sample of U[-10, 10] as in section 4.6.2."""
    n_features = len(problem.feature_names)
    if initial_weights is not None:
        return float_array("initial_weights", initial_weights, (n_features,))
    if rng is None:
        raise SerdError("initial_weights or rng must be given, got neither; pass one of them")
    require_generator(rng)
    return rng.uniform(-10.0, 10.0, n_features)


def starting_parameters(
    problem: Problem,
    policy_model: PolicyModel,
    initial_weights: FloatArray,
    dynamics: FloatArray,
    relation: Belief = TIED,
) -> Parameters:
    """All four blocks for given weights and dynamics; belief and truth start equal."""
    model = problem.mdp.transitions
    if relation.learns_dynamics:
        theta = model.parameters_of(dynamics)
    else:
        theta = model.fixed_parameters_of(dynamics)
    model.require_transitions(model.local_probabilities(theta))
    weights = float_array("initial_weights", initial_weights, (len(problem.feature_names),))
    return Parameters(
        reward=weights, belief=theta, truth=theta, policy=policy_model.initial_parameters
    )


#: What bounds or determines weights for which a learner has no prior.
WITH_PRIOR = "use fit_mdce_irl_by_likelihood with prior=PriorByEvidence()"


def reward_names(problem: Problem) -> list[str]:
    """(F,) names of the weights."""
    return [f"reward {name}" for name in problem.feature_names]


@dataclass(eq=False)
class RewardSearch:
    """Reward weights to find under known dynamics.

    policy_model: the policy that the weights are learned for; start: parameters to begin with;
    table: local probabilities of the dynamics, exactly as given; last_value: (S,) of `solution`.
    """

    problem: Problem
    observations: Observations
    policy_model: PolicyModel
    start: Parameters
    table: FloatArray
    last_value: FloatArray | None = None

    @cached_property
    def scale(self) -> FloatArray:
        """(F,) one over the range of each feature, in units of which weights are searched."""
        return 1.0 / feature_ranges(self.problem)

    @cached_property
    def transitions(self) -> Transitions:
        """The known dynamics."""
        return transitions_of(self.problem.mdp.transitions, self.table)

    def solution(self, weights: FloatArray) -> BellmanSolution:
        """The Bellman equation of the policy at (F,) weights, solved from the last value."""
        equation = self.policy_model.equation
        found = solution_at(self.problem, weights, self.transitions, equation, self.last_value)
        self.last_value = found.value
        return found

    def maximise(
        self,
        objective: Callable[[FloatArray], tuple[float, FloatArray]],
        ascent: Ascent,
        on_step: StepCallback | None,
        fix: str = WITH_PRIOR,
        n_observations: float | None = None,
    ) -> FitResult:
        """The fit at the maximum of a function of the (F,) weights with its gradient.

        n_observations: of which the function is a mean; None for the decisions.
        """
        require_kind("ascent", ascent, (Ascent,), "Lbfgs()")
        scaled = Scaled(FunctionObjective(objective), self.scale)
        ended = scaled.maximum(ascent, self.start.reward, on_step)
        return self.result(ended, scaled, fix, n_observations or self.observations.n_decisions)

    def result(
        self, ascended: AscentResult, scaled: Objective, fix: str, n_observations: float
    ) -> FitResult:
        """The fit of an ascent over the weights, with the likelihood of its policy."""
        ascended, undetermined = judged_weights(
            scaled, ascended, self.scale, reward_names(self.problem), fix, n_observations
        )
        assumptions = Assumptions(
            self.policy_model, FixedBelief(), UniformPrior(), by_likelihood=False
        )
        posterior = Posterior(self.problem, self.observations, self.policy_model, assumptions.prior)
        parameters = self.start.with_block(Block.REWARD, ascended.vector)
        final, tables = posterior.evaluate(parameters), (self.table, self.table, self.table)
        return fit_result(posterior, assumptions, parameters, final, ascended, tables, undetermined)


def reward_search(
    problem: Problem,
    decisions: Decisions,
    policy_model: PolicyModel,
    initial_weights: FloatArray | None,
    rng: np.random.Generator | None,
    dynamics: FloatArray | None,
) -> RewardSearch:
    """Prepare a search from the arguments that all these learners take."""
    require_shown(decisions, "learners of rewards by features or choices")
    observations = observe(problem, decisions)
    known = dynamics_or_estimate(problem, decisions, dynamics)
    weights = initial_weights_or_sample(problem, initial_weights, rng)
    return RewardSearch(
        problem=problem,
        observations=observations,
        policy_model=policy_model,
        start=starting_parameters(problem, policy_model, weights, known, FixedBelief()),
        table=problem.mdp.transitions.known_probabilities(known),
    )
