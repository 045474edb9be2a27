"""How the expert's belief about the dynamics relates to the true dynamics (Eqs. 4.8 to 4.10).

Tied: one block of parameters serves as both, and both gradient terms act on it. Free: two
blocks. Coupled: two blocks and a prior between them. Fixed: neither is learned, which turns SERD
into inverse reinforcement learning under given dynamics.

Each relation maps the four blocks to the vector an optimiser moves, and back. A temperature
theta_P > 0 is moved by its logarithm.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.posterior.parameters import Parameters
from serd_core.priors.coupling import CouplingPrior
from serd_core.priors.prior import Prior, UniformPrior


class Belief(ABC):
    """A relation between the blocks theta_TE and theta_T."""

    @property
    def prior(self) -> Prior:
        """The prior this relation brings along."""
        return UniformPrior()

    @property
    def learns_dynamics(self) -> bool:
        """Whether any dynamics move; where none do, they may rule outcomes out."""
        return True

    @abstractmethod
    def pack(self, parameters: Parameters) -> FloatArray:
        """Vector of the free numbers."""

    @abstractmethod
    def unpack(self, vector: FloatArray, like: Parameters) -> Parameters:
        """Blocks of a vector; `like` gives the lengths (and the values of fixed blocks)."""

    @abstractmethod
    def jacobian(self, at: Parameters) -> FloatArray:
        """(n, m) derivative of all blocks in a row (`Parameters.vector`) by the vector."""

    @abstractmethod
    def pull_back(self, gradient: Parameters, at: Parameters) -> FloatArray:
        """Gradient by the vector of a function with the given block gradients."""


@dataclass(frozen=True)
class TiedBelief(Belief):
    """The expert knows the dynamics: theta_TE = theta_T."""

    def pack(self, parameters: Parameters) -> FloatArray:
        """(F + N + 0 or 1,) reward, dynamics, log temperature."""
        return np.concatenate([parameters.reward, parameters.truth, np.log(parameters.policy)])

    def unpack(self, vector: FloatArray, like: Parameters) -> Parameters:
        """Blocks with belief and truth equal."""
        reward, truth, temperature = _split(vector, (like.reward, like.truth, like.policy))
        return Parameters(reward, truth, truth, np.exp(temperature))

    def jacobian(self, at: Parameters) -> FloatArray:
        """Both dynamics blocks follow one part of the vector."""
        reward, dynamics, temperature = _unit_blocks(at.reward, at.truth, at.policy)
        return np.concatenate([reward, dynamics, dynamics, at.policy[:, None] * temperature])

    def pull_back(self, gradient: Parameters, at: Parameters) -> FloatArray:
        """Both dynamics terms add up."""
        dynamics = gradient.belief + gradient.truth
        return np.concatenate([gradient.reward, dynamics, gradient.policy * at.policy])


@dataclass(frozen=True)
class FreeBelief(Belief):
    """The expert may be wrong in any way: theta_TE and theta_T are learned apart (4.10)."""

    def pack(self, parameters: Parameters) -> FloatArray:
        """(F + 2 N + 0 or 1,) reward, belief, truth, log temperature."""
        return np.concatenate(
            [parameters.reward, parameters.belief, parameters.truth, np.log(parameters.policy)]
        )

    def unpack(self, vector: FloatArray, like: Parameters) -> Parameters:
        """All four blocks."""
        reward, belief, truth, temperature = _split(
            vector, (like.reward, like.belief, like.truth, like.policy)
        )
        return Parameters(reward, belief, truth, np.exp(temperature))

    def jacobian(self, at: Parameters) -> FloatArray:
        """Each block follows its own part of the vector."""
        reward, belief, truth, temperature = _unit_blocks(at.reward, at.belief, at.truth, at.policy)
        return np.concatenate([reward, belief, truth, at.policy[:, None] * temperature])

    def pull_back(self, gradient: Parameters, at: Parameters) -> FloatArray:
        """Each block has its own term."""
        return np.concatenate(
            [gradient.reward, gradient.belief, gradient.truth, gradient.policy * at.policy]
        )


@dataclass(frozen=True)
class CoupledBelief(FreeBelief):
    """Two blocks kept similar by a prior of the given weight on their divergence."""

    weight: float

    @property
    def prior(self) -> Prior:
        """The coupling prior."""
        return CouplingPrior(self.weight)


@dataclass(frozen=True)
class FixedBelief(Belief):
    """Dynamics are given and stay as they are: inverse reinforcement learning."""

    @property
    def learns_dynamics(self) -> bool:
        """None move."""
        return False

    def pack(self, parameters: Parameters) -> FloatArray:
        """(F + 0 or 1,) reward, log temperature."""
        return np.concatenate([parameters.reward, np.log(parameters.policy)])

    def unpack(self, vector: FloatArray, like: Parameters) -> Parameters:
        """Blocks with the dynamics of `like`."""
        reward, temperature = _split(vector, (like.reward, like.policy))
        return Parameters(reward, like.belief, like.truth, np.exp(temperature))

    def jacobian(self, at: Parameters) -> FloatArray:
        """Dynamics blocks follow nothing."""
        reward, temperature = _unit_blocks(at.reward, at.policy)
        still = np.zeros((len(at.belief) + len(at.truth), reward.shape[1]))
        return np.concatenate([reward, still, at.policy[:, None] * temperature])

    def pull_back(self, gradient: Parameters, at: Parameters) -> FloatArray:
        """Dynamics terms have nothing to move."""
        return np.concatenate([gradient.reward, gradient.policy * at.policy])


def _split(vector: FloatArray, like: tuple[FloatArray, ...]) -> list[FloatArray]:
    ends = np.cumsum([len(block) for block in like])[:-1]
    return list(np.split(vector, ends))


def _unit_blocks(*blocks: FloatArray) -> list[FloatArray]:
    """Rows of an identity matrix, split into one piece per block."""
    sizes = [len(block) for block in blocks]
    return list(np.split(np.eye(sum(sizes)), np.cumsum(sizes)[:-1]))
