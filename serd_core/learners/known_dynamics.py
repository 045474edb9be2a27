"""What learners of rewards alone have in common: dynamics they take as known, and their result."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from serd_core.arrays import FloatArray, require_kind
from serd_core.ascent.ascent import (
    Ascent,
    AscentResult,
    FunctionObjective,
    Objective,
    Scaled,
    StepCallback,
)
from serd_core.ascent.open_directions import judged_weights
from serd_core.bellman.bellman_solver import BellmanSolution
from serd_core.demonstrations.decisions import Decisions, require_shown
from serd_core.demonstrations.observations import Observations, observe_in
from serd_core.dynamics.transition_model import Transitions, transitions_of
from serd_core.learners.fit_result import Assumptions, FitResult, fit_result
from serd_core.learners.start import (
    dynamics_or_estimate,
    initial_weights_or_sample,
    starting_parameters,
)
from serd_core.mdp.problem import Problem
from serd_core.policies.policy_model import PolicyModel
from serd_core.policies.solved_policy import solution_at
from serd_core.posterior.beliefs import FixedBelief
from serd_core.posterior.coordinates import feature_ranges
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior
from serd_core.priors.prior import UniformPrior

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
    ) -> FitResult:
        """The fit at the maximum of a function of the (F,) weights with its gradient.

        fix: what to do where it has none.
        """
        require_kind("ascent", ascent, (Ascent,), "Lbfgs()")
        scaled = Scaled(FunctionObjective(objective), self.scale)
        return self.result(scaled.maximum(ascent, self.start.reward, on_step), scaled, fix)

    def result(self, ascended: AscentResult, scaled: Objective, fix: str) -> FitResult:
        """The fit of an ascent over the weights, with the likelihood of its policy.

        scaled: what it maximised, over weights / scale. The fit has not converged where that has no
        maximum.
        """
        ascended, undetermined = judged_weights(
            scaled, ascended, self.scale, reward_names(self.problem), fix
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
    observations = observe_in(problem, decisions)
    known = dynamics_or_estimate(problem, decisions, dynamics)
    weights = initial_weights_or_sample(problem, initial_weights, rng)
    return RewardSearch(
        problem=problem,
        observations=observations,
        policy_model=policy_model,
        start=starting_parameters(problem, policy_model, weights, known, FixedBelief()),
        table=problem.mdp.transitions.known_probabilities(known),
    )
