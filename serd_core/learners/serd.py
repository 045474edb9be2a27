"""The unified SERD algorithm (Algorithm 1): rewards and dynamics at once, by MAP estimation.

The policy model says how experts choose (maximum causal entropy or policy matching), the belief
how what they believed relates to what is true, the prior what else is known, and the ascent how to
move. The gradient is that of the thesis, computed by adjoint instead of Q-gradient recursion.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from serd_core.arrays import FloatArray, float_array
from serd_core.ascent.ascent import Ascent, AscentResult, Objective, Step
from serd_core.ascent.lbfgs import Lbfgs
from serd_core.bellman.bellman_solver import BellmanSolver
from serd_core.bellman.newton import Newton
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import observe
from serd_core.derivatives.posterior_hessian import posterior_hessian, vector_hessian
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.learners.fit_result import Assumptions, FitResult
from serd_core.linear.automatic import Automatic
from serd_core.linear.linear_solver import LinearSolver
from serd_core.mdp.problem import Problem
from serd_core.policies.policy_model import PolicyModel
from serd_core.posterior.beliefs import Belief, TiedBelief
from serd_core.posterior.dynamics_likelihood import require_possible
from serd_core.posterior.parameters import Parameters
from serd_core.posterior.posterior import Posterior, PosteriorValue
from serd_core.priors.prior import Prior, UniformPrior

#: Told after each step (J per decision); returning True stops the fit there.
OnStep = Callable[[Step], bool | None]

TIED, UNIFORM, LBFGS = TiedBelief(), UniformPrior(), Lbfgs()


@dataclass(frozen=True)
class SerdSettings:
    """How a SERD fit is done; every part can be exchanged by object."""

    belief: Belief = TIED
    prior: Prior = UNIFORM
    ascent: Ascent = LBFGS
    solver: BellmanSolver = field(default_factory=Newton)
    linear_solver: LinearSolver = field(default_factory=Automatic)


def fit_serd(
    problem: Problem,
    decisions: Decisions,
    policy_model: PolicyModel,
    settings: SerdSettings,
    *,
    initial_weights: FloatArray,
    initial_dynamics: FloatArray,
    on_step: OnStep | None = None,
) -> FitResult:
    """Algorithm 1 from the given start."""
    observations = observe(problem.mdp, decisions)
    start = starting_parameters(
        problem, policy_model, initial_weights, initial_dynamics, settings.belief
    )
    initial_probabilities = problem.mdp.transitions.local_probabilities(start.truth)
    require_possible(observations, problem.mdp, initial_probabilities)
    assumptions = Assumptions(policy_model, settings.belief, settings.prior)
    prior = assumptions.whole_prior.anchored(initial_probabilities)
    posterior = Posterior(
        problem, observations, policy_model, prior, settings.solver, settings.linear_solver
    )
    climb = _Climb(posterior, settings.belief, start, observations.n_decisions)
    ascended = settings.ascent.maximise(
        climb, settings.belief.pack(start), lambda step: _told(on_step, step)
    )
    return _result(climb, ascended, assumptions)


def initial_dynamics_or_estimate(
    problem: Problem, decisions: Decisions, initial_dynamics: FloatArray | None
) -> FloatArray:
    """The given dynamics, or the M-estimate with a uniform prior (line 3 of Algorithm 1).

    In the terms of the model: an (M, K) table, or the parameters of a SparseModel. A model without
    parameters needs neither.
    """
    model = problem.mdp.transitions
    if initial_dynamics is None:
        return estimate_dynamics(problem, decisions) if model.n_parameters else np.zeros(0)
    table = np.asarray(initial_dynamics, dtype=np.float64)
    if isinstance(model, OutcomeModels):
        model.require_distributions(table)
    return table


def known_dynamics_or_estimate(
    problem: Problem, decisions: Decisions, dynamics: FloatArray | None
) -> FloatArray:
    """Local probabilities of the same dynamics, for learners of rewards alone."""
    known = initial_dynamics_or_estimate(problem, decisions, dynamics)
    return problem.mdp.transitions.known_probabilities(known)


def initial_weights_or_sample(
    problem: Problem, initial_weights: FloatArray | None, rng: np.random.Generator | None
) -> FloatArray:
    """The given (F,) weights, or a sample of U[-10, 10] as in section 4.6.2."""
    n_features = len(problem.feature_names)
    if initial_weights is not None:
        return float_array("initial_weights", initial_weights, (n_features,))
    if rng is None:
        raise SerdError("initial_weights or rng must be given, got neither; pass one of them")
    return rng.uniform(-10.0, 10.0, n_features)


@dataclass(eq=False)
class _Climb(Objective):
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


def starting_parameters(
    problem: Problem,
    policy_model: PolicyModel,
    initial_weights: FloatArray,
    initial_dynamics: FloatArray,
    relation: Belief = TIED,
) -> Parameters:
    """All four blocks for given weights and dynamics; belief and truth start equal."""
    model = problem.mdp.transitions
    if relation.learns_dynamics:
        theta = model.parameters_of(initial_dynamics)
    else:
        theta = model.fixed_parameters_of(initial_dynamics)
    model.require_stochastic(model.entries(model.local_probabilities(theta)))
    weights = float_array("initial_weights", initial_weights, (len(problem.feature_names),))
    return Parameters(
        reward=weights, belief=theta, truth=theta, policy=policy_model.initial_parameters
    )


def _told(on_step: OnStep | None, step: Step) -> bool:
    return on_step is not None and bool(on_step(step))


def _result(climb: _Climb, ascended: AscentResult, assumptions: Assumptions) -> FitResult:
    problem, model = climb.posterior.problem, climb.posterior.problem.mdp.transitions
    parameters = climb.belief.unpack(ascended.vector, climb.start)
    final = climb.at(parameters)
    probabilities = model.local_probabilities(parameters.truth)
    for theta in (parameters.belief, parameters.truth):
        # A map of the user's own may leave the distributions on the way.
        model.require_stochastic(model.entries(model.local_probabilities(theta)))
    shape = probabilities.shape if probabilities.size == parameters.truth.size else (-1,)
    return FitResult(
        feature_names=problem.feature_names,
        reward_weights=parameters.reward,
        outcome_parameters=parameters.truth.reshape(shape),
        outcome_probabilities=probabilities,
        believed_outcome_probabilities=model.local_probabilities(parameters.belief),
        initial_outcome_probabilities=model.local_probabilities(climb.start.truth),
        temperature=climb.posterior.policy_model.temperature(parameters.policy),
        parameters=parameters,
        objective=final.objective,
        policy_log_likelihood=final.policy_log_likelihood,
        dynamics_log_likelihood=final.dynamics_log_likelihood,
        log_prior=final.log_prior,
        gradient_norm=ascended.gradient_norm,
        n_decisions=climb.n_decisions,
        n_steps=ascended.n_steps,
        n_evaluations=ascended.n_evaluations,
        converged=ascended.converged and final.solution.converged,
        message=ascended.message,
        objective_trace=ascended.objective_trace * climb.n_decisions,
        residual=final.solution.residual,
        error_bound=final.solution.error_bound,
        assumptions=assumptions,
    )
