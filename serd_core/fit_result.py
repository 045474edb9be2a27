"""What a learner hands back."""

from dataclasses import dataclass

from serd_core.arrays import FloatArray
from serd_core.parameters import Parameters


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
