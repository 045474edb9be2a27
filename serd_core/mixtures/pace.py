"""How much faster or slower the types of a mixture move: the pace of each unit, summed up by type.

The time in a cell is that of `serd_core.arrival.dwell_times`, exp(x . beta + b) g, with the pace b
of an expert or episode and a mean time per outcome model of the action that left the cell. With
the posterior means m_u and variances v_u of the units' paces, the pace of type t is the normal
distribution of mean sum_u r_ut m_u / sum_u r_ut and variance sum_u r_ut ((m_u - mean)^2 + v_u) /
sum_u r_ut. `paced_law` applies it to a law of arrival.

Pace is no part of the likelihood of a type: decisions have equal periods, and what slow moves make
of these is in the shared dynamics.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.dwell_times import DwellModel, Pace, fit_dwell_times
from serd_core.demonstrations.decisions import Decisions, rows_by_trajectory
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.mixtures.expert_types import ExpertTypes

#: Times in cells from which paces are estimated.
FEWEST_TIMES = 10


@dataclass(frozen=True, eq=False)
class TypePaces:
    """units: (U,) paces in the order of `ExpertTypes.units`; types: (T,); model: of times."""

    units: tuple[Pace, ...]
    types: tuple[Pace, ...]
    model: DwellModel

    @property
    def factors(self) -> FloatArray:
        """(T,) by which the times of a type are longer than usual."""
        return np.exp([pace.mean for pace in self.types])


def pace_of_types(
    types: ExpertTypes, decisions: Decisions, experts: IntArray | None = None
) -> TypePaces:
    """Paces of the units that a mixture was fitted to, and of its types.

    SerdError where fewer than ten cells were left within a trajectory.
    """
    rows, dwell_s = times_in_cells(decisions)
    if len(dwell_s) < FEWEST_TIMES:
        raise SerdError(
            f"decisions must show at least {FEWEST_TIMES} times in cells, got {len(dwell_s)};"
            " record longer episodes"
        )
    labels = decisions.episode if experts is None else experts
    unit = np.searchsorted(types.units, labels[rows])
    models = types.objective.problem.mdp.transitions
    model = np.zeros(len(rows), dtype=np.int64)
    if isinstance(models, OutcomeModels) and not decisions.hidden[rows].any():
        model = models.model_of[decisions.state[rows], decisions.action[rows]]
    design = np.eye(int(model.max()) + 1)[model][:, np.unique(model)]
    kind = np.zeros(len(rows), dtype=np.int64)
    fitted = fit_dwell_times(dwell_s, design, kind, unit)
    units = tuple(
        fitted.pace(dwell_s[unit == u], design[unit == u], kind[unit == u])
        for u in range(len(types.units))
    )
    means, variances = (
        np.array([getattr(each, k) for each in units]) for k in ("mean", "variance")
    )
    return TypePaces(units, tuple(_mean_pace(means, variances, types.responsibilities)), fitted)


def has_enough_times(decisions: Decisions) -> bool:
    """Whether enough cells were left for `pace_of_types`."""
    return len(times_in_cells(decisions)[1]) >= FEWEST_TIMES


def times_in_cells(decisions: Decisions) -> tuple[IntArray, FloatArray]:
    """(n,) rows of the decisions that left a cell, and (n,) seconds since it was entered.

    The first cell of a trajectory does not count, as it was not entered.
    """
    rows, begins = rows_by_trajectory(decisions)
    state, time_s = decisions.state[rows], decisions.time_s[rows]
    entered = np.flatnonzero(begins | (np.diff(state, prepend=-1) != 0))
    left = entered[1:]
    whole = ~begins[left] & ~begins[entered[:-1]]
    dwell_s = np.diff(time_s[entered])[whole]
    return rows[left[whole] - 1], dwell_s


def _mean_pace(means: FloatArray, variances: FloatArray, shares: FloatArray) -> list[Pace]:
    found = []
    for weights in (shares / shares.sum(axis=0)).T:
        mean = float(weights @ means)
        found.append(Pace(mean, float(weights @ ((means - mean) ** 2 + variances))))
    return found
