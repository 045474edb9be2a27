"""What a learner hands back."""

from dataclasses import dataclass

from serd_core.arrays import FloatArray
from serd_core.policies.policy_model import PolicyModel
from serd_core.posterior.beliefs import Belief
from serd_core.posterior.parameters import Parameters
from serd_core.priors.prior import Prior


@dataclass(frozen=True)
class Assumptions:
    """What a fit took for granted; prior: without that of the belief."""

    policy_model: PolicyModel
    belief: Belief
    prior: Prior

    @property
    def whole_prior(self) -> Prior:
        """The prior with what the belief brings along."""
        return self.prior + self.belief.prior


@dataclass(frozen=True, eq=False)
class FitResult:
    """Learned rewards and dynamics, and how the fit went.

    reward_weights: (F,) theta_R in the order of feature_names; soft policies have temperature 1.
    outcome_parameters, outcome_probabilities: (M, K) energies and probabilities of the true
    dynamics; believed_outcome_probabilities: of the expert's belief; initial_...: the start.
    (For a SparseModel: its parameter vector and its entries.) Outcomes that fixed dynamics rule
    out have energies so low that their probability is exactly 0.
    temperature: theta_P, 1 where the policy model has none.
    gradient_norm: largest |dJ/d theta| per decision over the numbers that were free; at a kink that
    of the smallest mean of the gradients around (`serd_core.ascent.kinked`).
    converged: gradient norm within the ascent's tolerance and the last Bellman solve certified.
    objective_trace: (n_steps,) J after each step.
    residual, error_bound: certificate of that solve (`BellmanSolution`), NaN where a file keeps
    none; assumptions: what the fit took for granted, None where a file does not say.
    """

    feature_names: tuple[str, ...]
    reward_weights: FloatArray
    outcome_parameters: FloatArray
    outcome_probabilities: FloatArray
    believed_outcome_probabilities: FloatArray
    initial_outcome_probabilities: FloatArray
    temperature: float
    parameters: Parameters
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
