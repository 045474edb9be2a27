"""Rust (1987): bus engine replacement, estimated as SERD on real decisions.

Rust's model *is* the maximum causal entropy policy with unknown rewards and dynamics. States are
mileage bins since the last replacement, actions keep and replace, and one outcome model of
mileage increments serves both:

    R(x, keep) = -0.001 theta_11 x,   R(x, replace) = -RC,   P(x' | x, replace) = P(x' | 0, keep)

Conventions are those of the published tables: state = ceil(miles / bin) - 1; the decision to
replace falls in the last month before the odometer passes the replacement reading; each bus's first
month is dropped; after a replacement the increment is the new bin counted from one.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import Field

from lab.experiments.running.experiment import Findings, Session
from serd_core.arrays import FloatArray, IntArray
from serd_core.ascent.trust_region import TrustRegion
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult, StandardErrors
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.uncertainty.standard_errors import fit_information, standard_errors
from serd_files.settings import setting
from serd_files.yaml_config import StrictModel

KEEP, REPLACE = 0, 1
FEATURE_NAMES = ("maintenance", "replacement")
HEADER_LENGTH = 11
FIRST_REPLACEMENT, SECOND_REPLACEMENT = 5, 8
#: Longest odometer reading divided into 90 bins of 5,000 miles.
MILES_COVERED = 450_000.0

#: Group to file and values per bus.
GROUPS = {
    1: ("g870.asc", 36),
    2: ("rt50.asc", 60),
    3: ("t8h203.asc", 81),
    4: ("a530875.asc", 128),
    5: ("a530874.asc", 137),
    6: ("a452374.asc", 137),
    7: ("a530872.asc", 137),
    8: ("a452372.asc", 137),
}


class RustConfig(StrictModel):
    """Settings of the bus engine replacement problem (Rust 1987)."""

    data: Path = setting(..., "the folder of Rust's odometer files (a530875.asc for group 4)")
    groups: tuple[Annotated[int, Field(ge=1, le=8)], ...] = setting(
        (4,), "groups of buses, 1 to 8", min_length=1
    )
    n_bins: int = setting(90, "bins of the odometer reading", ge=2)
    discount: float = setting(0.9999, "discount per month", ge=0, lt=1)

    @property
    def bin_miles(self) -> float:
        """Width of a mileage bin."""
        return MILES_COVERED / self.n_bins


@dataclass(frozen=True, eq=False)
class RustResult:
    """Estimates as printed in Rust's Table IX, with BHHH standard errors."""

    n_decisions: int
    n_replacements: int
    replacement_cost: float
    replacement_cost_error: float
    maintenance_cost: float
    maintenance_cost_error: float
    increments: FloatArray
    increment_errors: FloatArray
    log_likelihood: float
    fit: FitResult
    errors: StandardErrors


def run_rust(config: RustConfig, session: Session) -> Findings:
    """The estimates with their errors."""
    result = estimate_rust(config)
    session.progress(1, 1)
    increments = zip(result.increments, result.increment_errors, strict=True)
    rows = [
        ("RC", result.replacement_cost, result.replacement_cost_error),
        ("theta_11", result.maintenance_cost, result.maintenance_cost_error),
        *((f"increment {number}", *each) for number, each in enumerate(increments)),
        ("log-likelihood", result.log_likelihood, None),
    ]
    table = pd.DataFrame(rows, columns=["name", "estimate", "error"])
    return Findings(table, {"estimates.csv": table})


def estimate_rust(config: RustConfig) -> RustResult:
    """Joint maximum-likelihood estimate of rewards and dynamics."""
    increments, rows = bus_months(config)
    n_increments = int(increments.max()) + 1
    problem = rust_problem(config.n_bins, n_increments, config.discount)
    decisions = as_decisions(rows, increments, config.n_bins)
    fit = fit_mdce_serd(
        problem,
        decisions,
        initial_weights=np.array([2.0, 10.0]),
        ascent=TrustRegion(gradient_tolerance=1e-9),
    )
    information = fit_information(problem, decisions, fit)
    errors = standard_errors(problem, information, information.outer_product)
    return RustResult(
        n_decisions=len(decisions),
        n_replacements=int(np.sum(decisions.action == REPLACE)),
        replacement_cost=float(fit.reward_weights[1]),
        replacement_cost_error=float(errors.reward[1]),
        maintenance_cost=float(fit.reward_weights[0]),
        maintenance_cost_error=float(errors.reward[0]),
        increments=fit.outcome_probabilities.ravel()[:n_increments],
        increment_errors=errors.outcome_probabilities.ravel()[:n_increments],
        log_likelihood=fit.policy_log_likelihood + fit.dynamics_log_likelihood,
        fit=fit,
        errors=errors,
    )


def rust_problem(n_bins: int, n_increments: int, discount: float) -> TabularProblem:
    """The replacement problem with one outcome model of mileage increments."""
    bins, steps = np.arange(n_bins), np.arange(n_increments)
    successors = np.empty((n_bins, 2, n_increments), dtype=np.int64)
    successors[:, KEEP] = np.minimum(bins[:, None] + steps, n_bins - 1)
    successors[:, REPLACE] = steps
    model_of, available = np.zeros((n_bins, 2), dtype=np.int64), np.ones((n_bins, 2), bool)
    models = OutcomeModels(successors, model_of, available, n_models=1)
    features = np.zeros((n_bins, 2, 2))
    features[:, KEEP, 0] = -0.001 * bins
    features[:, REPLACE, 1] = -1.0
    return TabularProblem(Mdp(models, discount), features, FEATURE_NAMES)


def bus_months(config: RustConfig) -> tuple[IntArray, IntArray]:
    """(n,) mileage increment that led into each bus-month, and (n, 3) bus, state, decision."""
    increments, rows = [], []
    bus = 0
    for group in config.groups:
        for column in read_group(config.data, group):
            state, decision = states_and_decisions(column, config.bin_miles)
            increments.append(monthly_increments(state, decision))
            rows.append(np.column_stack([np.full(len(state) - 1, bus), state[1:], decision[1:]]))
            bus += 1
    return np.concatenate(increments), np.concatenate(rows)


def read_group(data: Path, group: int) -> NDArray[np.float64]:
    """(buses, values) of one original file."""
    name, n_values = GROUPS[group]
    path = data / name
    if not path.is_file():
        raise SerdError(f"data must hold {name} for group {group}, but {path} is missing")
    return np.loadtxt(path).reshape(-1, n_values)


def states_and_decisions(column: FloatArray, bin_miles: float) -> tuple[IntArray, IntArray]:
    """Mileage bin since the last replacement, and decision, of each month of one bus."""
    odometer = column[HEADER_LENGTH:]
    since = odometer.copy()
    decision = np.zeros(len(odometer), dtype=np.int64)
    for reading in (column[FIRST_REPLACEMENT], column[SECOND_REPLACEMENT]):
        if reading > 0:
            passed = odometer > reading
            since[passed] = odometer[passed] - reading
            decision[int(np.argmax(passed)) - 1] = REPLACE
    return np.ceil(since / bin_miles).astype(np.int64) - 1, decision


def monthly_increments(state: IntArray, decision: IntArray) -> IntArray:
    """(months - 1,) bins passed in each month; after a replacement the new bin from one."""
    replaced = decision[:-1] == REPLACE
    return np.where(replaced, state[1:] + 1, state[1:] - state[:-1])


def as_decisions(rows: IntArray, increments: IntArray, n_bins: int) -> Decisions:
    """Table of decisions in which each bus-month carries the increment that led into it.

    Increments do not depend on the state, so the likelihood is the published one: the choices of
    all months but the first, and all observed increments.
    """
    bus, state, action = rows.T
    following = np.where(action == REPLACE, increments, np.minimum(state + increments, n_bins - 1))
    return Decisions(
        episode=bus,
        time_s=np.arange(len(bus), dtype=np.float64),
        state=state,
        action=action,
        next_state=following,
        source="Rust (1987)",
    )
