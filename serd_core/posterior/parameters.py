"""The parameters theta of the SERD problem in their four blocks (section 4.2).

theta_R (reward), theta_TE (what the expert believed), theta_T (what the world does) and theta_P
(the expert's policy). The same record holds a gradient by them.
"""

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.display import Record


class Block(Enum):
    """The block of parameters that a prior is on.

    REWARD: weights; TRUTH: dynamics of the world; BELIEF: those that the expert believes in;
    POLICY: the temperature of `fit_pm_serd`.
    """

    REWARD = "reward"
    BELIEF = "belief"
    TRUTH = "truth"
    POLICY = "policy"


@dataclass(frozen=True, eq=False, repr=False)
class Parameters(Record):
    """Four flat blocks: reward (F,), belief (N,), truth (N,), policy (0,) or (1,)."""

    reward: FloatArray
    belief: FloatArray
    truth: FloatArray
    policy: FloatArray

    @property
    def vector(self) -> FloatArray:
        """All blocks in a row: reward, belief, truth, policy."""
        return np.concatenate(self._blocks)

    @property
    def _blocks(self) -> tuple[FloatArray, ...]:
        return self.reward, self.belief, self.truth, self.policy

    def with_vector(self, vector: FloatArray) -> "Parameters":
        """Blocks of these lengths filled from such a row."""
        ends = np.cumsum([len(self.reward), len(self.belief), len(self.truth)])
        return Parameters(*np.split(vector, ends))

    def place(self, name: Block) -> slice:
        """Where a block stands in that row."""
        number = list(Block).index(name)
        start = sum(map(len, self._blocks[:number]))
        return slice(start, start + len(self._blocks[number]))

    def placed(self, name: Block, table: FloatArray) -> FloatArray:
        """(n, n) over that row with a table in the place of a block, 0 elsewhere."""
        whole, place = np.zeros((len(self.vector),) * 2), self.place(name)
        whole[place, place] = table
        return whole

    def block(self, name: Block) -> FloatArray:
        """The block of that name."""
        values: FloatArray = getattr(self, name.value)
        return values

    def with_block(self, name: Block, values: FloatArray) -> "Parameters":
        """A copy with one block exchanged."""
        return replace(self, **{name.value: values})

    def zeros(self) -> "Parameters":
        """Blocks of the same lengths filled with zeros."""
        return Parameters(*(np.zeros(len(block)) for block in self._blocks))

    def __add__(self, other: "Parameters") -> "Parameters":
        return Parameters(*map(np.add, self._blocks, other._blocks))
