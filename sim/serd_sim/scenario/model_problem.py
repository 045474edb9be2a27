"""The decision problem of a learned model in a scenario.

Apart from `grid`, as nodes that learn nothing load no model files.
"""

import numpy as np

from serd_bag.errors import FileError
from serd_core.arrays import IntArray
from serd_core.errors import SerdError
from serd_core.grid.grid import Grid
from serd_core.grid.navigation import NO_FLOW, NavigationProblem, features_of_flow, with_dwell_times
from serd_files.model_file import ModelFile
from serd_sim.scenario.grid import flow_of, navigation_problem_of
from serd_sim.scenario.scenario import Scenario


def problem_of_model(
    path: str, file: ModelFile, scenario: Scenario, grid: Grid, *, transferred: bool = False
) -> tuple[NavigationProblem, ModelFile]:
    """The problem to plan in, whose decisions take time, and the model with its features alone.

    transferred: whether the model was learned on another grid, so that its flow is not that of this
    one. FileError where the file has an unknown feature.
    """
    own_flow = None if transferred else file.flow_on(path, grid)
    flow = flow_of(scenario, grid) if own_flow is None else own_flow
    known = model_in_flow(file, flow)
    try:
        problem = navigation_problem_of(scenario, file.discount, known.feature_names, flow)
        pace = np.log(file.pace) if file.pace and not transferred else None
        timed = with_dwell_times(
            problem, patience_s=scenario.patience_s, wait_s=scenario.wait_s, log_pace=pace
        )
    except SerdError as error:
        raise FileError(f"{path}: {error}; learn the model again") from None
    return timed, known


def model_in_flow(file: ModelFile, flow: IntArray) -> ModelFile:
    """The model with the weights that count in a place with a flow (S,).

    That of the social norm does not where no people walk, as the place has no such feature. Models
    that older versions learned in such a place have one too, which is the weight of waiting.
    """
    learned_in = np.full_like(flow, NO_FLOW) if file.without_flow else flow
    return file.with_features(features_of_flow(learned_in, file.feature_names))
