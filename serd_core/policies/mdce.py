"""Maximum discounted causal entropy policy: Boltzmann over soft Q-values (Eq. 4.13)."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.bellman.soft import SoftBellman
from serd_core.policies.policy_model import PolicyModel


@dataclass(frozen=True)
class MdcePolicy(PolicyModel):
    """pi(a | s) = exp(Q(s, a) - V(s)) with soft Q; no parameters, temperature 1."""

    @property
    def equation(self) -> SoftBellman:
        """Soft Bellman equation (3.28)."""
        return SoftBellman()

    @property
    def initial_parameters(self) -> FloatArray:
        """None."""
        return np.zeros(0)

    def temperature(self, policy_parameters: FloatArray) -> float:
        """One: the scale of the reward weights says how noisy the expert is."""
        del policy_parameters
        return 1.0

    def parameter_gradient(
        self, policy_parameters: FloatArray, q: FloatArray, log_policy_gradient: FloatArray
    ) -> FloatArray:
        """Empty."""
        del policy_parameters, q, log_policy_gradient
        return np.zeros(0)

    def parameter_curvature(
        self, policy_parameters: FloatArray, q: FloatArray, counts: FloatArray
    ) -> tuple[FloatArray, float]:
        """Nothing."""
        del policy_parameters, q
        return np.zeros_like(counts), 0.0
