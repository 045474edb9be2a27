"""The pictures beside tables and models; without Matplotlib none is drawn.

A function of a picture that lies beside other results returns why nothing was drawn, empty where
something was.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from serd_app.demonstrations.flow_field import FlowField
from serd_app.demonstrations.recorded import (
    Place,
    RecordedDemonstrations,
    concatenated,
    files_beside,
)
from serd_app.navigation.comparison import predicted_law
from serd_bag.files import delete_file
from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import state_counts
from serd_core.grid.grid import Grid
from serd_files.errors import missing_extra
from serd_files.table import EpisodeResult
from serd_sim.drivers.strategy import Strategy
from serd_sim.scenario.scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def save_gain_picture(path: Path, grid: Grid, gain_nats: FloatArray) -> str:
    """Draw the information (S,) that a demonstration from each cell is expected to add."""
    if missing := _missing():
        return missing
    from serd_app.report.figures.maps import draw_gain

    _save(path, draw_gain(None, grid, gain_nats))
    return ""


def save_pictures_of_demonstrations(
    output: Path, place: Place, found: Sequence[RecordedDemonstrations], flow: FlowField | None
) -> str:
    """Draw the tracks, and the flow of people where there is one, beside the table `output`."""
    if missing := _missing():
        return missing
    from serd_app.report.figures.maps import draw_flow_map, draw_visitation

    files = files_beside(output)
    visits = state_counts(concatenated(found), place.grid.n_states)
    tracks = [track for each in found for track in each.tracks_m]
    _save(files["picture"], draw_visitation(place.scenario, place.grid, visits, tracks))
    if flow is None:
        delete_file(files["flow picture"])
        return ""
    figure = draw_flow_map(
        place.grid, flow.flow, flow.order, scenario=place.scenario, scenario_flow=place.flow
    )
    _save(files["flow picture"], figure)
    return ""


def save_arrival_picture(
    path: Path, strategy: Strategy, start_area: str, episodes: Sequence[EpisodeResult]
) -> str:
    """Draw predicted and measured share of arrivals over time, with bands."""
    if missing := _missing():
        return missing
    from serd_app.report.figures.arrival import draw_comparison

    times_s = [row.time_of_arrival_s if row.arrived else math.inf for row in episodes]
    law = predicted_law(strategy, start_area)
    _save(path, draw_comparison(law, times_s, strategy.timeout_s))
    return ""


def save_plan(path: Path, scenario: Scenario) -> None:
    """Draw a scenario from above as PNG; its folder is made."""
    from serd_app.report.figures.maps import draw_scenario_plan

    _save(path, draw_scenario_plan(scenario))


def _missing() -> str:
    try:
        import matplotlib  # noqa: F401
    except ModuleNotFoundError as error:
        return f"no picture is drawn: {missing_extra(error)}"
    return ""


def _save(path: Path, figure: "Figure") -> None:
    from serd_app.report.style import save_figure

    save_figure(path, figure)
