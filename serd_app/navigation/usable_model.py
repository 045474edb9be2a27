"""The model file that a strategy may use in a scenario: its own, or with transfer another's.

What carries over to another place are the reward weights by feature name and the outcome
probabilities by model name; they mean the same only for cells and decision periods of the same
size. The place's own grid, flow, walls and goal make a new problem of them.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.errors import SerdError
from serd_core.grid.grid import Outcome
from serd_core.grid.navigation import NavigationProblem
from sim.scenario.grid import grid_of, navigation_problem_of
from sim.scenario.scenario import Scenario
from storage.errors import FileError
from storage.model_file import ModelFile, load_model, require_grid

_OUTCOME_NAMES = tuple(outcome.name.lower() for outcome in Outcome)


@dataclass(frozen=True, eq=False)
class UsableModel:
    """A model on a scenario's problem; outcome_probabilities: (M, K) in the problem's order."""

    file: ModelFile
    problem: NavigationProblem
    outcome_probabilities: FloatArray
    transferred: bool


def usable_model(
    path: str, scenario: Scenario, *, transfer: bool, model: ModelFile | None = None
) -> UsableModel:
    """The model on the scenario's own problem, goal area included; FileError where it cannot be.

    transfer: whether a model learned on another grid is wanted at all. model: what the file held
    when it was read before; it is read now when None.
    """
    model = load_model(path) if model is None else model
    grid = grid_of(scenario)
    transferred = model.grid.fingerprint != grid.fingerprint()
    if transferred and not transfer:
        require_grid(path, model, grid)
    _require_same_scale(path, model, scenario)
    flow = None if transferred else model.flow_on(path, grid)
    try:
        problem = navigation_problem_of(scenario, model.discount, model.feature_names, flow)
    except SerdError as error:
        raise FileError(f"{path}: {error}; learn the model again") from None
    return UsableModel(model, problem, _probabilities(path, model, problem), transferred)


def _require_same_scale(path: str, model: ModelFile, scenario: Scenario) -> None:
    for what, there, here in (
        ("cells", model.grid.cell_size_m, scenario.cell_size_m),
        ("decision periods", model.decision_period_s, scenario.decision_period_s),
    ):
        if there != here:
            unit = "m" if what == "cells" else "s"
            raise FileError(
                f"{path}: was learned with {what} of {there:g} {unit}, but {scenario.name!r} has "
                f"{here:g} {unit}; its outcome probabilities hold for its own only: learn one here"
            )


def _probabilities(path: str, model: ModelFile, problem: NavigationProblem) -> FloatArray:
    """(M, K) rows and columns by name."""
    rows = {each.name: each.learned for each in model.outcome_models}
    for kind, needed, there in (
        ("outcome_models", problem.model_names, rows),
        ("outcome_names", _OUTCOME_NAMES, model.outcome_names),
    ):
        missing = [name for name in needed if name not in there]
        if missing:
            raise FileError(
                f"{path}: {kind} must have {', '.join(needed)}, but {missing[0]!r} is missing"
                "; learn the model again"
            )
    columns = [model.outcome_names.index(name) for name in _OUTCOME_NAMES]
    return np.array([[rows[name][column] for column in columns] for name in problem.model_names])
