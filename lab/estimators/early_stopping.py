"""Stopping an ascent when a validation score no longer improves (section 5.2)."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import (
    LBFGS,
    Ascent,
    AscentResult,
    Climb,
    Objective,
    Step,
    StepCallback,
    largest,
)
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import observe
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import fit_serd
from serd_core.learners.start import (
    TIED,
    dynamics_or_estimate,
    initial_weights_or_sample,
    starting_parameters,
)
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import PolicyModel
from serd_core.posterior.beliefs import Belief
from serd_core.posterior.parameters import Parameters
from serd_core.posterior.posterior import Posterior, expected_counts, expected_log_policy
from serd_core.priors.prior import UniformPrior


@dataclass(frozen=True)
class EarlyStopping(Ascent):
    """Runs another ascent and returns the step with the best score.

    score: vector (n,) to a number, larger is better; it does not change the ascent otherwise.
    patience: steps without improvement after which the ascent is stopped.
    """

    inner: Ascent
    score: Callable[[FloatArray], float]
    patience: int = 20

    def __post_init__(self) -> None:
        """The other ascent has its own limits."""

    def tries(self, climb: Climb) -> Iterator[None]:
        """The tries of the other ascent."""
        return self.inner.tries(climb)

    def maximise(
        self, objective: Objective, start: FloatArray, on_step: StepCallback | None = None
    ) -> AscentResult:
        """Climb; the result is the best step, and its message gives the score."""
        first = self.score(start)
        if np.isnan(first):
            # No later score would compare as better, and the start would be returned as the best.
            raise SerdError(
                f"score of the start must be a number, got {first}; score validation decisions that"
                " the problem allows"
            )
        watch = _Watch(self, on_step, np.array(start), first)
        result = self.inner.maximise(objective, start, watch)
        if np.array_equal(watch.best_vector, result.vector):
            return result
        value, gradient = objective.evaluate(watch.best_vector)
        return replace(
            result,
            vector=watch.best_vector,
            objective=value,
            gradient_norm=largest(gradient),
            n_steps=watch.best_step,
            n_evaluations=result.n_evaluations + 1,
            converged=False,
            message=f"stopped early: best validation score {watch.best_score:.6g} at step"
            f" {watch.best_step}",
            objective_trace=result.objective_trace[: watch.best_step],
        )


@dataclass(eq=False)
class _Watch:
    settings: EarlyStopping
    on_step: StepCallback | None
    best_vector: FloatArray
    best_score: float
    best_step: int = 0

    def __call__(self, step: Step) -> bool:
        score = self.settings.score(step.vector)
        if score > self.best_score:
            self.best_score, self.best_step = score, step.number
            self.best_vector = step.vector.copy()
        stopped = self.on_step is not None and bool(self.on_step(step))
        return stopped or step.number - self.best_step >= self.settings.patience


def fit_serd_with_early_stopping(
    problem: Problem,
    decisions: Decisions,
    validation: Decisions,
    policy_model: PolicyModel,
    *,
    initial_weights: FloatArray | None = None,
    rng: np.random.Generator | None = None,
    dynamics: FloatArray | None = None,
    ascent: Ascent = LBFGS,
    patience: int = 20,
    on_step: StepCallback | None = None,
) -> FitResult:
    """`fit_serd` on the (training) decisions, ended by the likelihood of the validation ones."""
    observe(problem, decisions)  # rejects what no learner takes
    weights = initial_weights_or_sample(problem, initial_weights, rng)
    given = dynamics_or_estimate(problem, decisions, dynamics, learned=True)
    like = starting_parameters(problem, policy_model, weights, given)
    score = validation_score(problem, validation, policy_model, TIED, like)
    return fit_serd(
        problem,
        decisions,
        policy_model,
        initial_weights=weights,
        dynamics=given,
        ascent=EarlyStopping(ascent, score, patience),
        on_step=on_step,
    )


def validation_score(
    problem: Problem,
    decisions: Decisions,
    policy_model: PolicyModel,
    belief: Belief,
    like: Parameters,
) -> Callable[[FloatArray], float]:
    """Mean log-likelihood of validation decisions as a function of the free vector.

    like: parameters of the fit's block lengths (and of its fixed blocks).
    """
    observations = observe(problem, decisions)
    posterior = Posterior(problem, observations, policy_model, UniformPrior())

    def score(vector: FloatArray) -> float:
        _, true, _, log_policy = posterior.solved(belief.unpack(vector, like))
        total = expected_log_policy(observations.state_action, log_policy)
        total += expected_counts(observations, log_policy, true).log_likelihood
        return total / observations.n_decisions

    return score
