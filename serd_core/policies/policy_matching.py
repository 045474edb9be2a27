"""Policy matching: Boltzmann over optimal Q-values with a temperature (Eqs. 3.11, 4.62, 4.63)."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.bellman.hard import HardBellman
from serd_core.bellman.soft import boltzmann
from serd_core.errors import SerdError
from serd_core.policies.policy_model import PolicyModel


@dataclass(frozen=True)
class PolicyMatchingPolicy(PolicyModel):
    """pi(a | s) proportional to exp(Q*(s, a) / theta_P); theta_P starts at `start_temperature`."""

    start_temperature: float = 1.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.start_temperature) and self.start_temperature > 0):
            raise SerdError(
                f"start_temperature must be finite and above 0, got {self.start_temperature}"
            )

    @property
    def equation(self) -> HardBellman:
        """Bellman equation of optimal control (2.24)."""
        return HardBellman()

    @property
    def initial_parameters(self) -> FloatArray:
        """(1,) the starting temperature."""
        return np.array([self.start_temperature])

    def temperature(self, policy_parameters: FloatArray) -> float:
        """theta_P."""
        return float(policy_parameters[0])

    def parameter_gradient(
        self, policy_parameters: FloatArray, q: FloatArray, log_policy_gradient: FloatArray
    ) -> FloatArray:
        """(1,) sum w (E_pi[Q] - Q) / theta_P^2 (4.63, second case)."""
        temperature = self.temperature(policy_parameters)
        shortfall = _shortfall(boltzmann(q, temperature), q)
        return np.array([np.sum(log_policy_gradient * shortfall) / temperature**2])

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
