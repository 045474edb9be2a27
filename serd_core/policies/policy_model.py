"""Policy models pi = g(theta_P, Q) with their Bellman equation and derivatives (section 4.4).

Maximum discounted causal entropy: Boltzmann over soft Q-values (Eq. 4.13).
Policy matching: Boltzmann over optimal Q-values with a temperature (Eqs. 3.11, 4.62, 4.63).
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from serd_core.arrays import FloatArray, largest_per_row, require_positive, sum_per_row
from serd_core.bellman.equations import BellmanEquation, HardBellman, SoftBellman, boltzmann


class PolicyModel:
    """pi_theta(a | s) = g(theta_P, Q)(s, a); without parameters unless overridden.

    equation: the one whose Q the policy is made of.
    """

    equation: ClassVar[BellmanEquation]

    @property
    def initial_parameters(self) -> FloatArray:
        """theta_P to start from; empty where the model has none."""
        return np.zeros(0)

    def temperature(self, policy_parameters: FloatArray) -> float:
        """Temperature of the Boltzmann distribution over Q."""
        del policy_parameters
        return 1.0

    def parameter_scores(self, policy_parameters: FloatArray, q: FloatArray) -> FloatArray:
        """(S, A, p) derivative of log pi(a | s) by the p numbers of theta_P."""
        del policy_parameters
        return np.zeros((*q.shape, 0))

    def parameter_gradient(
        self, policy_parameters: FloatArray, q: FloatArray, log_policy_gradient: FloatArray
    ) -> FloatArray:
        """Gradient by theta_P of sum_sa w(s,a) log pi(a|s) for w = `log_policy_gradient`."""
        scores = self.parameter_scores(policy_parameters, q)
        return np.tensordot(log_policy_gradient, scores, axes=2)

    def parameter_curvature(
        self, policy_parameters: FloatArray, q: FloatArray, counts: FloatArray
    ) -> tuple[FloatArray, float]:
        """(S, A) derivative of `parameter_gradient` by Q, and its derivative by theta_P."""
        del policy_parameters, q
        return np.zeros_like(counts), 0.0

    def log_probabilities(self, policy_parameters: FloatArray, q: FloatArray) -> FloatArray:
        """(S, A) log pi(a | s); -inf where an action is unavailable."""
        scaled = q - largest_per_row(q)[:, None]
        scaled /= self.temperature(policy_parameters)
        scaled -= np.log(sum_per_row(np.exp(scaled)))[:, None]
        return scaled

    def q_gradient(
        self, policy_parameters: FloatArray, policy: FloatArray, counts: FloatArray
    ) -> FloatArray:
        """(S, A) derivative by Q of sum_sa n(s,a) log pi(a|s): (n(s,a) - n(s) pi) / temperature."""
        visits = sum_per_row(counts)
        seen = np.flatnonzero(visits)
        surprise = counts[seen] - visits[seen, None] * policy[seen]
        # `zeros` allocates pages only where they are written; `zeros_like` writes all of them.
        gradient = np.zeros(counts.shape)
        gradient[seen] = surprise / self.temperature(policy_parameters)
        return gradient


@dataclass(frozen=True)
class MdcePolicy(PolicyModel):
    """pi(a | s) = exp(Q(s, a) - V(s)) with soft Q (3.28); no parameters, temperature 1.

    The scale of the reward weights expresses how noisy the expert is.
    """

    equation = SoftBellman()


@dataclass(frozen=True)
class PolicyMatchingPolicy(PolicyModel):
    """pi(a | s) proportional to exp(Q*(s, a) / theta_P); theta_P starts at `start_temperature`."""

    equation = HardBellman()
    start_temperature: float = 1.0

    def __post_init__(self) -> None:
        require_positive("start_temperature", self.start_temperature)

    @property
    def initial_parameters(self) -> FloatArray:
        return np.array([self.start_temperature], dtype=float)

    def temperature(self, policy_parameters: FloatArray) -> float:
        """theta_P, whose powers are infinite where Python's would raise OverflowError."""
        return np.float64(policy_parameters[0])

    def parameter_scores(self, policy_parameters: FloatArray, q: FloatArray) -> FloatArray:
        """(S, A, 1) (E_pi[Q] - Q) / theta_P^2 (4.63, second case)."""
        temperature = self.temperature(policy_parameters)
        shortfall = _shortfall(boltzmann(q, temperature), q)
        return np.asarray(shortfall[:, :, None] / temperature**2)

    def parameter_curvature(
        self, policy_parameters: FloatArray, q: FloatArray, counts: FloatArray
    ) -> tuple[FloatArray, float]:
        """(S, A) and a number: derivatives of sum n (E_pi[Q] - Q) / theta_P^2."""
        temperature = self.temperature(policy_parameters)
        policy, visits = boltzmann(q, temperature), counts.sum(axis=1, keepdims=True)
        shortfall = _shortfall(policy, q)
        by_q = visits * policy * (1.0 - shortfall / temperature) - counts
        variance = np.sum(policy * shortfall**2, axis=1)
        first = float(np.sum(counts * shortfall))
        spread = float(np.sum(visits[:, 0] * variance))
        return by_q / temperature**2, -spread / temperature**4 - 2.0 * first / temperature**3


def _shortfall(policy: FloatArray, q: FloatArray) -> FloatArray:
    """(S, A) E_pi[Q] - Q, with 0 taken for Q where an action is unavailable."""
    finite_q = np.where(np.isfinite(q), q, 0.0)
    return np.asarray(np.sum(policy * finite_q, axis=1, keepdims=True) - finite_q)
