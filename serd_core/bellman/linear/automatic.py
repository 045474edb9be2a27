"""Choice of the linear solver by the predicted work of each.

The work of a sparse LU follows from its fill, which is counted for the pattern of the MDP before
anything is factorised: on grids it grows little faster than the states, on random graphs with their
cube. The iterations of BiCGSTAB grow with the root of the horizon 1 / (1 - gamma) up to a multiple
of the depth of the graph, hardly with the states, and with the digits that are asked for: Newton's
steps need few. LU goes by band where that is narrow: three
times faster than a sparse factor on 20 x 20 cells, four times in hallways of any length, no faster
on 60 x 60.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.bellman.linear.krylov import Krylov
from serd_core.bellman.linear.linear_solver import LinearSolver, LinearSystem, WithFallback
from serd_core.bellman.linear.lu import BandedLu, SparseLu
from serd_core.bellman.linear.policy_pattern import PolicyPattern

LU = SparseLu()
BAND = BandedLu()
# Seconds of a factorisation, a solution, an iteration; ratios vary little between machines.
_PER_PRODUCT_S, _PER_FILL_S, _PER_STATE_S = 0.15e-9, 60e-9, 0.1e-6
_PER_SOLVED_S = 4e-9
_PER_BAND_PRODUCT_S, _PER_BAND_STATE_S = 0.22e-9, 80e-9
_PER_ITERATION_S, _PER_ENTRY_S, _PER_ELEMENT_S = 25e-6, 1.1e-9, 4.5e-9
#: Iterations for a residual of FINEST: per root of the horizon, and at most per step of depth.
FINEST = 1e-11
_LEAST, _PER_ROOT_HORIZON, _PER_DEPTH = 10.0, 6.0, 6.0
#: Share of those by horizon that fewer digits take at least, up to a horizon; over longer ones the
#: first digits take nearly as many iterations as all of them, or fail.
_FEW_DIGITS, _LONGEST_FOR_FEW = 0.5, 300.0
#: A graph in which all states are this near (times log2 of their number) and have more than two
#: neighbours has no small separator, so even ordering it for LU is expensive.
_NEAR, _FEW_NEIGHBOURS = 1.5, 2.2


@dataclass(frozen=True)
class Automatic(LinearSolver):
    """Banded LU, sparse LU or BiCGSTAB, by predicted work; LU is the fallback of BiCGSTAB.

    small_states: LU up to this number of states, where nothing is worth a prediction.
    largest_lu_states: beyond, a factor may not fit, and long horizons use an incomplete one.
    long_horizon: where that begins; widest_band: off-diagonals on either side up to which a band is
    factorised; relative_residual: the least that is asked for; right_sides: of each system.
    """

    small_states: int = 500
    largest_lu_states: int = 300_000
    long_horizon: float = 1_000.0
    widest_band: int = 65
    relative_residual: float = FINEST
    right_sides: int = 1

    def for_systems(self, *, relative_residual: float = 0.0, right_sides: int = 1) -> LinearSolver:
        """The choice for systems of so many right-hand sides, solved to no less than a residual."""
        finest = max(relative_residual, FINEST)
        return replace(self, relative_residual=finest, right_sides=right_sides)

    def choose(self, pattern: PolicyPattern, horizon: float) -> LinearSolver:
        """The solver for a pattern and a horizon 1 / (1 - gamma)."""
        n_states = pattern.n_states
        if n_states <= self.small_states:
            return BAND if self._is_narrow(pattern) else LU
        if n_states > self.largest_lu_states:
            return Krylov(fill=10.0) if horizon > self.long_horizon else Krylov()
        digits = math.log(self.relative_residual) / math.log(FINEST)
        share = max(digits, _FEW_DIGITS) if horizon <= _LONGEST_FOR_FEW else 1.0
        by_horizon = share * _PER_ROOT_HORIZON * math.sqrt(horizon)
        growth = min(by_horizon, _PER_DEPTH * pattern.depth)
        krylov_s = self.right_sides * (_LEAST + growth) * _iteration_s(pattern)
        band_s = n_states * (_PER_BAND_STATE_S + _PER_BAND_PRODUCT_S * pattern.band.width**2)
        if self._is_narrow(pattern) and band_s <= krylov_s:
            return BAND
        return LU if self._lu_is_faster_than(krylov_s, pattern) else Krylov()

    def chosen(self, pattern: PolicyPattern, data: FloatArray) -> LinearSolver:
        """The solver for a matrix."""
        is_small = pattern.n_states <= self.small_states  # the horizon then does not count
        return self.choose(pattern, 0.0 if is_small else _horizon(pattern, data))

    def prepare(self, pattern: PolicyPattern, data: FloatArray) -> LinearSystem:
        """Prepare with the chosen solver; LU is the fallback where it fits."""
        chosen = self.chosen(pattern, data)
        system = chosen.prepare(pattern, data)
        if isinstance(chosen, Krylov) and pattern.n_states <= self.largest_lu_states:
            return WithFallback(system, LU, pattern, data)
        return system

    def _is_narrow(self, pattern: PolicyPattern) -> bool:
        return pattern.band.width <= self.widest_band

    def _lu_is_faster_than(self, limit_s: float, pattern: PolicyPattern) -> bool:
        n_states, n_entries = pattern.n_states, len(pattern.column)
        if _PER_STATE_S * n_states + _PER_FILL_S * n_entries > limit_s:
            return False
        n_neighbours = n_entries / n_states - 1.0
        if pattern.depth <= _NEAR * math.log2(n_states) and n_neighbours > _FEW_NEIGHBOURS:
            return False
        fill = pattern.elimination.fill
        if fill is None:
            return False
        more_s = _PER_SOLVED_S * (self.right_sides - 1)  # the first is in the fill's
        work_s = _PER_PRODUCT_S * fill.products + (_PER_FILL_S + more_s) * fill.entries
        return work_s + _PER_STATE_S * n_states <= limit_s


def _horizon(pattern: PolicyPattern, data: FloatArray) -> float:
    """1 / (1 - gamma): every row of I - gamma P_pi sums to 1 - gamma."""
    gap = float(np.max(pattern.matrix(data) @ np.ones(pattern.n_states)))
    return 1.0 / max(gap, float(np.finfo(np.float64).tiny))


def _iteration_s(pattern: PolicyPattern) -> float:
    work_s = _PER_ENTRY_S * len(pattern.column) + _PER_ELEMENT_S * pattern.n_states
    return _PER_ITERATION_S + work_s
