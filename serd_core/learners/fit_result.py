"""The record every learner returns."""

from dataclasses import dataclass

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import AscentResult
from serd_core.mdp.problem import Problem
from serd_core.policies.policy_model import PolicyModel
from serd_core.posterior.beliefs import Belief
from serd_core.posterior.parameters import Parameters
from serd_core.posterior.posterior import PosteriorValue
from serd_core.priors.prior import Prior


@dataclass(frozen=True)
class Assumptions:
    """What a fit assumed; prior: without that of the belief."""

    policy_model: PolicyModel
    belief: Belief
    prior: Prior

    @property
    def whole_prior(self) -> Prior:
        """The prior together with that of the belief."""
        return self.prior + self.belief.prior


@dataclass(frozen=True, eq=False)
class FitResult:
    """Learned rewards and dynamics, and how the fit went.

    parameters: all blocks at the end; outcomes that fixed dynamics rule out have energies so low
    that their probability is exactly 0.
    outcome_probabilities: (M, K) of the true dynamics; believed_outcome_probabilities: of the
    expert's belief; initial_outcome_probabilities: the start. (For a SparseModel: its entries.)
    temperature: theta_P; 1 where the policy model has none, as soft policies do.
    objective: what the learner maximised, for SERD the log posterior J, else by its own docstring;
    objective_trace: (n_steps,) the same after each step.
    gradient_norm: largest entry of the gradient over the numbers that were free, for SERD per
    decision; at a kink that of the smallest mean of the gradients around (`KinkedAscent`).
    converged: the gradient norm is within the ascent's tolerance, the last Bellman solve certified,
    and where J is smooth Newton's method finds the only maximum there (`learners.certificate`).
    undetermined: directions along which J is constant; a fit that has any did not converge.
    residual, error_bound: certificate of that solve (`BellmanSolution`), NaN where a file has none;
    assumptions: None where a file does not state them.
    """

    feature_names: tuple[str, ...]
    parameters: Parameters
    outcome_probabilities: FloatArray
    believed_outcome_probabilities: FloatArray
    initial_outcome_probabilities: FloatArray
    temperature: float
    objective: float
    policy_log_likelihood: float
    dynamics_log_likelihood: float
    log_prior: float
    gradient_norm: float
    n_decisions: int
    n_steps: int
    n_evaluations: int
    converged: bool
    message: str
    objective_trace: FloatArray
    residual: float
    error_bound: float
    assumptions: Assumptions | None
    undetermined: tuple[str, ...] = ()

    @property
    def reward_weights(self) -> FloatArray:
        """(F,) theta_R in the order of `feature_names`."""
        return self.parameters.reward


def fit_result(
    problem: Problem,
    assumptions: Assumptions,
    parameters: Parameters,
    final: PosteriorValue,
    ascended: AscentResult,
    *,
    tables: tuple[FloatArray, FloatArray, FloatArray],
    n_decisions: int,
    objective: float,
    objective_trace: FloatArray,
    undetermined: tuple[str, ...] = (),
) -> FitResult:
    """The record of an ascent that ended at `parameters`, where the posterior is `final`.

    tables: outcome probabilities that were learned, believed and started from.
    """
    truth, belief, initial = tables
    return FitResult(
        feature_names=problem.feature_names,
        parameters=parameters,
        outcome_probabilities=truth,
        believed_outcome_probabilities=belief,
        initial_outcome_probabilities=initial,
        temperature=assumptions.policy_model.temperature(parameters.policy),
        objective=objective,
        policy_log_likelihood=final.policy_log_likelihood,
        dynamics_log_likelihood=final.dynamics_log_likelihood,
        log_prior=final.log_prior,
        gradient_norm=ascended.gradient_norm,
        n_decisions=n_decisions,
        n_steps=ascended.n_steps,
        n_evaluations=ascended.n_evaluations,
        converged=ascended.converged and final.solution.converged,
        message=ascended.message,
        objective_trace=objective_trace,
        residual=final.solution.residual,
        error_bound=final.solution.error_bound,
        assumptions=assumptions,
        undetermined=undetermined,
    )
