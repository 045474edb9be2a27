"""Choice of the linear solver by the size of a problem and the width of its band.

A band is factorised where it is narrow, as in hallways of any length, and a sparse matrix of few
states too. Elsewhere BiCGSTAB takes less time than a factor, unless one factor serves many
right-hand sides; of graphs whose band is wide, which have no small separators, factors fill up.
"""

from dataclasses import dataclass, replace

from serd_core.arrays import FloatArray
from serd_core.bellman.linear.krylov import Krylov
from serd_core.bellman.linear.linear_solver import LinearSolver, LinearSystem, WithFallback
from serd_core.bellman.linear.lu import BandedLu, SparseLu
from serd_core.bellman.linear.policy_pattern import PolicyPattern

#: Share of the states that a band covers where factors fill up, and states from which that counts.
WIDE, SMALL_STATES = 0.25, 500
#: Right-hand sides from which a factor pays, and states up to which it then does.
MANY_SIDES, LARGEST_SHARED_LU = 10, 300_000


@dataclass(frozen=True)
class Automatic(LinearSolver):
    """Banded LU, sparse LU or BiCGSTAB, whichever fits; sparse LU is the fallback of BiCGSTAB.

    widest_band: off-diagonals on either side up to which a band is factorised.
    largest_lu_states: sparse LU up to this number of states, BiCGSTAB beyond.
    """

    widest_band: int = 65
    largest_lu_states: int = 5_000

    def for_systems(self, *, right_sides: int) -> LinearSolver:
        if right_sides <= MANY_SIDES or self.largest_lu_states != Automatic.largest_lu_states:
            return self
        return replace(self, largest_lu_states=LARGEST_SHARED_LU)

    def choose(self, pattern: PolicyPattern) -> LinearSolver:
        """The solver for the systems of a pattern."""
        n_states = pattern.n_states
        if pattern.band.width <= self.widest_band:
            return BandedLu()
        fills_up = n_states > SMALL_STATES and pattern.band.width > WIDE * n_states
        if n_states <= self.largest_lu_states and not fills_up:
            return SparseLu()
        return Krylov()

    def prepare(self, pattern: PolicyPattern, data: FloatArray) -> LinearSystem:
        solver = self.choose(pattern)
        system = solver.prepare(pattern, data)
        if isinstance(solver, Krylov):
            return WithFallback(system, SparseLu(), pattern, data)
        return system
