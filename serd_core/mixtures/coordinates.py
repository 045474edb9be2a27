"""Coordinates of a mixture of T types, in which its log posterior is a density.

The row u has: log odds of the shares without gauge, then per type its reward weights and, where
beliefs are free, its belief, and last the dynamics that all types share (or believe in as well):

    u = [shares | rewards 1..T | beliefs 1..T | dynamics]

Units and gauge are left out as in `serd_core.posterior.coordinates`. The free numbers of type t
are `tables[t] @ u`.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, IntArray
from serd_core.mdp.problem import Problem
from serd_core.posterior.beliefs import Belief
from serd_core.posterior.coordinates import feature_ranges, free_names, gauge_free_basis
from serd_core.posterior.parameters import Block, Parameters


@dataclass(frozen=True, eq=False)
class MixtureCoordinates:
    """D coordinates of the shares and the T x m free numbers.

    tables: (T, m, D); share_table: (T, D), log shares = table @ u up to a constant; like:
    parameters that give blocks that are fixed. own: (T, q) places of each type's own coordinates.
    names: (m,) of the free numbers of a type; log_volume: log |d(all reward weights) / du|.
    """

    belief: Belief
    like: Parameters
    tables: FloatArray
    share_table: FloatArray
    own: IntArray
    names: tuple[str, ...]
    log_volume: float

    @property
    def n_types(self) -> int:
        """T."""
        return len(self.tables)

    @property
    def size(self) -> int:
        """D."""
        return int(self.tables.shape[2])

    def parameters(self, u: FloatArray) -> tuple[Parameters, ...]:
        """All blocks of each type."""
        return tuple(self.belief.unpack(table @ u, self.like) for table in self.tables)

    def log_shares(self, u: FloatArray) -> FloatArray:
        """(T,) of the types."""
        energies = self.share_table @ u
        energies = energies - energies.max()
        return np.asarray(energies - np.log(np.exp(energies).sum()))

    def of(self, parameters: tuple[Parameters, ...], log_shares: FloatArray) -> FloatArray:
        """(D,) coordinates of types, whose shared blocks are averaged."""
        free = np.concatenate([self.belief.pack(each) for each in parameters])
        tables = np.concatenate([*self.tables, self.share_table])
        centred = log_shares - log_shares.mean()
        # The columns of the stacked tables are orthogonal.
        columns = tables / np.sum(tables**2, axis=0)
        return np.asarray(columns.T @ np.concatenate([free, centred]))

    def reordered(self, u: FloatArray, order: IntArray) -> FloatArray:
        """The same mixture with its types in another order."""
        parameters = self.parameters(u)
        return self.of(tuple(parameters[t] for t in order), self.log_shares(u)[order])

    def describe(self, direction: FloatArray) -> str:
        """The type and free number that move most along a direction (D,)."""
        parts = self.tables @ direction
        number, row = np.unravel_index(int(np.argmax(np.abs(parts))), parts.shape)
        if np.linalg.norm(self.share_table @ direction) > np.linalg.norm(parts):
            return "the shares of the types"
        return f"{self.names[row]} of type {number + 1}"


def mixture_coordinates(
    problem: Problem, belief: Belief, like: Parameters, n_types: int
) -> MixtureCoordinates:
    """Those of a problem's types under a belief."""
    ranges, gauge = feature_ranges(problem), problem.mdp.transitions.gauge
    energies = gauge_free_basis(gauge) if len(gauge) else np.eye(len(like.truth))
    shares = gauge_free_basis(np.ones((1, n_types)) / np.sqrt(n_types))
    own = [g for g in belief.groups if Block.TRUTH not in g]
    blocks = {g: np.diag(1.0 / ranges) if Block.REWARD in g else energies for g in belief.groups}
    place, begins = n_types - 1, {}
    for group in belief.groups:
        width = blocks[group].shape[1]
        begins[group] = [place + t * width if group in own else place for t in range(n_types)]
        place += width * (n_types if group in own else 1)
    tables = np.zeros((n_types, sum(len(block) for block in blocks.values()), place))
    for number, table in enumerate(tables):
        row = 0
        for group, block in blocks.items():
            first = begins[group][number]
            table[row : row + len(block), first : first + block.shape[1]] = block
            row += len(block)
    widths = {group: np.arange(blocks[group].shape[1]) for group in own}
    places = [np.array(begins[group])[:, None] + widths[group] for group in own]
    share_table = np.zeros((n_types, place))
    share_table[:, : n_types - 1] = shares
    return MixtureCoordinates(
        belief=belief,
        like=like,
        tables=tables,
        share_table=share_table,
        own=np.concatenate(places, axis=1),
        names=free_names(problem, like, belief.jacobian(like)),
        log_volume=-n_types * float(np.sum(np.log(ranges))),
    )
