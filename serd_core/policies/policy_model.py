"""What every policy model offers: its Bellman equation, log pi and derivatives by Q and theta_P."""

from abc import ABC, abstractmethod

import numpy as np

from serd_core.arrays import FloatArray, largest_per_row, sum_per_row
from serd_core.bellman.equation import BellmanEquation


class PolicyModel(ABC):
    """pi_theta(a | s) = g(theta_P, Q)(s, a)."""

    @property
    @abstractmethod
    def equation(self) -> BellmanEquation:
        """The Bellman equation whose Q the policy is made of."""

    @property
    @abstractmethod
    def initial_parameters(self) -> FloatArray:
        """theta_P to start from; empty where the model has none."""

    @abstractmethod
    def temperature(self, policy_parameters: FloatArray) -> float:
        """Temperature of the Boltzmann distribution over Q."""

    @abstractmethod
    def parameter_gradient(
        self, policy_parameters: FloatArray, q: FloatArray, log_policy_gradient: FloatArray
    ) -> FloatArray:
        """Gradient by theta_P of sum_sa w(s,a) log pi(a|s) for w = `log_policy_gradient`."""

    @abstractmethod
    def parameter_curvature(
        self, policy_parameters: FloatArray, q: FloatArray, counts: FloatArray
    ) -> tuple[FloatArray, float]:
        """(S, A) derivative of `parameter_gradient` by Q, and its derivative by theta_P."""

    def log_probabilities(self, policy_parameters: FloatArray, q: FloatArray) -> FloatArray:
        """(S, A) log pi(a | s); -inf where an action is unavailable."""
        scaled = (q - largest_per_row(q)[:, None]) / self.temperature(policy_parameters)
        return np.asarray(scaled - np.log(sum_per_row(np.exp(scaled)))[:, None])

    def q_gradient(
        self, policy_parameters: FloatArray, policy: FloatArray, counts: FloatArray
    ) -> FloatArray:
        """(S, A) derivative by Q of sum_sa n(s,a) log pi(a|s): (n(s,a) - n(s) pi) / temperature."""
        surprise = counts - sum_per_row(counts)[:, None] * policy
        return np.asarray(surprise / self.temperature(policy_parameters))
