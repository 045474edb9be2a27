"""How certain a fit is: standard errors, and what the decisions alone do not determine."""

from dataclasses import dataclass

import numpy as np

from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from serd_core.grid.navigation import NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.uncertainty.identifiability import Identifiability, identifiability
from serd_core.uncertainty.information import Information, fit_information
from serd_core.uncertainty.standard_errors import StandardErrors, standard_errors


@dataclass(frozen=True, eq=False)
class Certainty:
    """errors: with the prior's part, None where `problem` states why there are none.

    identifiability: of the likelihood alone, None where the fit has none. open_rewards: features,
    open_outcomes: (model, outcome) numbers that it leaves open; open_temperature: likewise.
    """

    errors: StandardErrors | None
    problem: str = ""
    identifiability: Identifiability | None = None
    open_rewards: tuple[str, ...] = ()
    open_outcomes: tuple[tuple[int, int], ...] = ()
    open_temperature: bool = False


def certainty_of(problem: NavigationProblem, decisions: Decisions, fit: FitResult) -> Certainty:
    """Standard errors with the prior's part; what is identified by the decisions alone."""
    try:
        information = fit_information(problem, decisions, fit)
    except SerdError as error:
        return Certainty(None, str(error))
    found = identifiability(information)
    rows = _open_rows(information, found)
    n_features, n_dynamics = len(fit.parameters.reward), len(fit.parameters.truth)
    n_outcomes = problem.outcome_models.n_outcomes
    dynamics = {
        (row - n_features) % n_dynamics for row in rows if 0 <= row - n_features < 2 * n_dynamics
    }
    errors, reason = None, ""
    try:
        errors = standard_errors(problem, information, information.observed)
    except SerdError as error:
        reason = str(error)
    return Certainty(
        errors,
        reason,
        found,
        tuple(fit.feature_names[row] for row in rows if row < n_features),
        tuple(divmod(number, n_outcomes) for number in sorted(dynamics)),
        any(row >= n_features + 2 * n_dynamics for row in rows),
    )


def _open_rows(information: Information, found: Identifiability) -> list[int]:
    """Places in the row of all parameters that move along a null direction, ascending."""
    names = {name for direction in found.null for name, _ in direction.loadings}
    columns = [number for number, name in enumerate(information.names) if name in names]
    return np.flatnonzero(information.jacobian[:, columns].any(axis=1)).tolist()
