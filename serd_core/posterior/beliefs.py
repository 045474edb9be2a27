"""How the expert's belief about the dynamics relates to the true dynamics (Eqs. 4.8 to 4.10).

Tied: one block of parameters serves as both, and both gradient terms act on it. Free: two
blocks. Coupled: two blocks and a prior between them. Fixed: neither is learned, which turns SERD
into inverse reinforcement learning under given dynamics.

Each relation maps the four blocks to the vector an optimiser moves, and back. A temperature
theta_P > 0 is moved by its logarithm.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.divergence import CouplingPrior
from serd_core.priors.prior import Prior, UniformPrior, require_weight


class Belief:
    """A relation between the blocks theta_TE and theta_T.

    groups: blocks in the order of the vector; those of one group are equal and move as one. The
    logarithm of the temperature follows them. Other blocks stay fixed.
    learns_dynamics: whether any dynamics move; where none do, they may rule outcomes out.
    """

    groups: ClassVar[tuple[tuple[Block, ...], ...]]
    learns_dynamics: ClassVar[bool] = True

    @property
    def prior(self) -> Prior:
        """The prior that comes with this relation."""
        return UniformPrior()

    def places(self, like: Parameters) -> Iterator[tuple[tuple[Block, ...], slice]]:
        """Each group with its place in the vector; `like` gives the lengths."""
        start = 0
        for group in self.groups:
            yield group, (place := slice(start, start + len(like.block(group[0]))))
            start = place.stop

    def pack(self, parameters: Parameters) -> FloatArray:
        """(m,) vector of the free numbers."""
        blocks = [parameters.block(group[0]) for group in self.groups]
        return np.concatenate([*blocks, np.log(parameters.policy)])

    def unpack(self, vector: FloatArray, like: Parameters) -> Parameters:
        """Blocks of a vector; `like` gives the lengths (and the values of fixed blocks)."""
        moved: dict[str, FloatArray] = {}
        for group, place in self.places(like):
            # One array for equal blocks, so that their transitions are computed once.
            moved |= dict.fromkeys((block.value for block in group), vector[place])
        return replace(like, policy=np.exp(vector[place.stop :]), **moved)

    def jacobian(self, at: Parameters) -> FloatArray:
        """(n, m) derivative of all blocks in a row (`Parameters.vector`) by the vector."""
        table = np.zeros((len(at.vector), len(self.pack(at))))
        for group, place in self.places(at):
            for block in group:
                table[at.place(block), place] = np.eye(place.stop - place.start)
        table[at.place(Block.POLICY), place.stop :] = np.diag(at.policy)
        return table

    def pull_back(self, gradient: Parameters, at: Parameters) -> FloatArray:
        """(m,) gradient by the vector of a function with the given block gradients."""
        parts = [sum(map(gradient.block, group), np.zeros(1)) for group in self.groups]
        return np.concatenate([*parts, gradient.policy * at.policy])


@dataclass(frozen=True)
class TiedBelief(Belief):
    """Belief of a fit in which the expert knows the dynamics: believed and true ones are equal."""

    groups = (Block.REWARD,), (Block.BELIEF, Block.TRUTH)


@dataclass(frozen=True)
class FreeBelief(Belief):
    """Belief of a fit in which the expert may be wrong: both dynamics are learned apart (4.10)."""

    groups = (Block.REWARD,), (Block.BELIEF,), (Block.TRUTH,)


@dataclass(frozen=True)
class CoupledBelief(FreeBelief):
    """Belief of a fit in which a prior keeps what the expert believes near the truth.

    weight: at least 0, of the divergence sum P_T log(P_T / P_TE) over all transitions, in nats.
    """

    weight: float

    def __post_init__(self) -> None:
        require_weight("weight", self.weight)

    @property
    def prior(self) -> Prior:
        return CouplingPrior(self.weight)


@dataclass(frozen=True)
class FixedBelief(Belief):
    """Belief of a fit whose dynamics are given and stay: inverse reinforcement learning."""

    groups = ((Block.REWARD,),)
    learns_dynamics = False
