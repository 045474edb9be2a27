"""Choice of the linear solver by the size of a problem and the length of its horizon.

A band is factorised where it is narrow, as in hallways of any length. Elsewhere a sparse LU costs
about as much as one iteration of BiCGSTAB per 25 states on grids and more on denser graphs, whose
factors fill up. BiCGSTAB takes iterations in proportion to the root of the horizon 1 / (1 - gamma),
up to a multiple of the depth of the graph.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.bellman.linear.krylov import Krylov
from serd_core.bellman.linear.linear_solver import LinearSolver, LinearSystem, WithFallback
from serd_core.bellman.linear.lu import BandedLu, SparseLu
from serd_core.bellman.linear.policy_pattern import PolicyPattern

#: Iterations of BiCGSTAB: per root of the horizon, and at most per step of depth.
PER_ROOT_HORIZON, PER_DEPTH = 6.0, 6.0
#: Depth, in units of log2 of the states, of graphs without small separators: factors fill up.
NEAR = 1.5
#: Right-hand sides up to which BiCGSTAB may cost less than a factor, which serves all of them.
FEW_SIDES = 10


@dataclass(frozen=True)
class Automatic(LinearSolver):
    """Banded LU, sparse LU or BiCGSTAB, whichever fits; LU is the fallback of BiCGSTAB.

    widest_band: off-diagonals on either side up to which a band is factorised.
    small_states: sparse LU up to this number of states.
    states_per_iteration: BiCGSTAB beyond, where it needs at most an iteration per so many states.
    largest_lu_states: beyond, a factor may not fit; horizons of `long_horizon` then use an
    incomplete one.
    right_sides: of each system; a factor serves all of them, BiCGSTAB solves one after another.
    """

    widest_band: int = 65
    small_states: int = 500
    states_per_iteration: int = 25
    largest_lu_states: int = 300_000
    long_horizon: float = 1_000.0
    right_sides: int = 1

    def for_systems(self, *, right_sides: int) -> LinearSolver:
        """The choice for systems of so many right-hand sides."""
        return replace(self, right_sides=right_sides)

    def choose(self, pattern: PolicyPattern, horizon: float) -> LinearSolver:
        """The solver for a pattern and a horizon 1 / (1 - gamma)."""
        n_states = pattern.n_states
        if n_states > self.largest_lu_states:
            return Krylov(fill=10.0) if horizon > self.long_horizon else Krylov()
        if pattern.band.width <= self.widest_band:
            return BandedLu()
        if n_states <= self.small_states:
            return SparseLu()
        iterations = min(PER_ROOT_HORIZON * math.sqrt(horizon), PER_DEPTH * pattern.depth)
        few = self.right_sides <= FEW_SIDES and iterations <= n_states / self.states_per_iteration
        near = pattern.depth <= NEAR * math.log2(n_states)
        return Krylov() if few or near else SparseLu()

    def chosen(self, pattern: PolicyPattern, data: FloatArray) -> LinearSolver:
        """The solver for a matrix; every row of I - gamma P_pi sums to 1 - gamma."""
        gap = float(np.max(pattern.matrix(data) @ np.ones(pattern.n_states)))
        return self.choose(pattern, 1.0 / max(gap, float(np.finfo(np.float64).tiny)))

    def prepare(self, pattern: PolicyPattern, data: FloatArray) -> LinearSystem:
        """Prepare with the chosen solver; LU is the fallback where it fits."""
        chosen = self.chosen(pattern, data)
        system = chosen.prepare(pattern, data)
        if isinstance(chosen, Krylov) and pattern.n_states <= self.largest_lu_states:
            return WithFallback(system, SparseLu(), pattern, data)
        return system
