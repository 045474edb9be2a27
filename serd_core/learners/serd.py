"""The unified SERD algorithm (Algorithm 1): rewards and dynamics at once, by MAP estimation.

The policy model defines how experts choose (maximum causal entropy or policy matching), the belief
how what they believed relates to what is true, the prior what else is known, and the ascent how
parameters move. The gradient is that of the thesis, by adjoint instead of Q-gradient recursion.
"""

from dataclasses import dataclass, field

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import Ascent, Objective, StepCallback
from serd_core.ascent.lbfgs import Lbfgs
from serd_core.bellman.bellman_solver import BellmanSolver
from serd_core.bellman.linear.automatic import Automatic
from serd_core.bellman.linear.linear_solver import LinearSolver
from serd_core.bellman.newton import Newton
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import observe
from serd_core.learners.fit_result import Assumptions, FitResult, fit_result
from serd_core.learners.start import (
    TIED,
    dynamics_or_estimate,
    initial_weights_or_sample,
    starting_parameters,
)
from serd_core.mdp.problem import Problem
from serd_core.policies.policy_model import PolicyModel
from serd_core.posterior.beliefs import Belief
from serd_core.posterior.derivatives.posterior_hessian import posterior_hessian, vector_hessian
from serd_core.posterior.parameters import Parameters
from serd_core.posterior.posterior import Posterior, PosteriorValue, require_possible
from serd_core.priors.prior import Prior, UniformPrior

UNIFORM, LBFGS = UniformPrior(), Lbfgs()


@dataclass(frozen=True)
class SerdSettings:
    """How a SERD fit is done; every part can be exchanged by object."""

    belief: Belief = TIED
    prior: Prior = UNIFORM
    ascent: Ascent = LBFGS
    solver: BellmanSolver = field(default_factory=Newton)
    linear_solver: LinearSolver = field(default_factory=Automatic)


SETTINGS = SerdSettings()


def fit_serd(
    problem: Problem,
    decisions: Decisions,
    policy_model: PolicyModel,
    settings: SerdSettings = SETTINGS,
    *,
    initial_weights: FloatArray | None = None,
    rng: np.random.Generator | None = None,
    dynamics: FloatArray | None = None,
    on_step: StepCallback | None = None,
) -> FitResult:
    """Algorithm 1.

    initial_weights: (F,), or None for a sample of U[-10, 10] from `rng`.
    dynamics: (M, K) probabilities to start from, or the parameters of a SparseModel; None for the
    M-estimate with a uniform prior.
    on_step: called after each step, with J per decision; returning True stops the fit.
    """
    weights = initial_weights_or_sample(problem, initial_weights, rng)
    given = dynamics_or_estimate(problem, decisions, dynamics)
    observations = observe(problem.mdp, decisions)
    start = starting_parameters(problem, policy_model, weights, given, settings.belief)
    initial_probabilities = problem.mdp.transitions.local_probabilities(start.truth)
    require_possible(observations, problem.mdp, initial_probabilities)
    assumptions = Assumptions(policy_model, settings.belief, settings.prior)
    prior = assumptions.whole_prior.anchored(initial_probabilities)
    posterior = Posterior(
        problem, observations, policy_model, prior, settings.solver, settings.linear_solver
    )
    objective = _LogPosterior(posterior, settings.belief, start, observations.n_decisions)
    ascended = settings.ascent.maximise(objective, settings.belief.pack(start), on_step)
    parameters = settings.belief.unpack(ascended.vector, start)
    final = objective.at(parameters)
    truth, belief = (
        _checked_probabilities(problem, theta) for theta in (parameters.truth, parameters.belief)
    )
    return fit_result(
        problem,
        assumptions,
        parameters,
        final,
        ascended,
        tables=(truth, belief, initial_probabilities),
        n_decisions=observations.n_decisions,
        objective=final.objective,
        objective_trace=ascended.objective_trace * observations.n_decisions,
    )


@dataclass(eq=False)
class _LogPosterior(Objective):
    """J per decision as a function of the free vector, warm-started from the last value."""

    posterior: Posterior
    belief: Belief
    start: Parameters
    n_decisions: int
    last_value: FloatArray | None = None

    def evaluate(self, vector: FloatArray) -> tuple[float, FloatArray]:
        """J per decision and its gradient by the free vector."""
        parameters = self.belief.unpack(vector, self.start)
        found = self.at(parameters)
        gradient = self.belief.pull_back(found.gradient, parameters)
        return found.objective / self.n_decisions, gradient / self.n_decisions

    def hessian(self, vector: FloatArray) -> FloatArray:
        """Exact second derivatives of J per decision by the free vector."""
        parameters = self.belief.unpack(vector, self.start)
        found = self.at(parameters)
        blocks = posterior_hessian(self.posterior, parameters, found)
        return vector_hessian(self.belief, blocks, found.gradient, parameters) / self.n_decisions

    def at(self, parameters: Parameters) -> PosteriorValue:
        """The posterior at given parameters."""
        found = self.posterior.evaluate(parameters, self.last_value)
        self.last_value = found.solution.value
        return found


def _checked_probabilities(problem: Problem, theta: FloatArray) -> FloatArray:
    """Local probabilities; a SparseModel's map may have left the distributions on the way."""
    model = problem.mdp.transitions
    probabilities = model.local_probabilities(theta)
    model.require_stochastic(model.entries(probabilities))
    return probabilities
