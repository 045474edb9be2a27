"""The hallway: at one recorded moment with robot and people, and as the plan of a scenario."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from serd_app.report import style
from serd_app.report.figures.map_axes import (
    cell_squares,
    draw_areas,
    draw_vectors,
    map_figure,
)
from serd_app.report.inputs import CrowdSnapshot
from serd_app.report.style import Look
from serd_core.arrays import FloatArray
from serd_sim.crowd.routes import offset_loop
from serd_sim.scenario.polygon import edges_of
from serd_sim.scenario.scenario import Scenario

_PERSON_RADIUS_M = 0.22
_ARROW_PER_SPEED_S = 0.7
_LOOKS = ((style.PERSON_COLOUR, "-"), (style.PURPLE, "--"), (style.CYAN, "-."), (style.INK, ":"))
#: Loops that share a leg are drawn side by side.
_BESIDE_M = 0.13
_ARROW_EVERY_M = 4.0
_LARGEST_GRID = 4000


def draw_hallway(scenario: Scenario, snapshot: CrowdSnapshot) -> Figure:
    """Fig. 5.6 with a recorded crowd: arrows show where each person is in 0.7 s at this speed."""
    with style.report_style():
        figure, axes = map_figure(scenario)
        draw_areas(axes, scenario, filled=True)
        for trail in np.swapaxes(snapshot.people_trail_m, 0, 1):
            _fading_trail(axes, trail, style.PERSON_COLOUR, width=1.6)
        _fading_trail(axes, snapshot.robot_trail_m, style.ROBOT_COLOUR, width=2.4)
        _people(axes, snapshot)
        _robot(axes, snapshot.robot_pose, scenario.robot.radius_m)
        axes.set_title(f"{len(snapshot.people_position_m)} people at t = {snapshot.time_s:.1f} s")
        figure.legend(handles=_legend(), loc="outside lower center", ncols=2, handlelength=1.2)
    return figure


def _people(axes: Axes, snapshot: CrowdSnapshot) -> None:
    look = {"facecolor": style.PERSON_COLOUR, "edgecolor": "white", "linewidth": 0.6, "zorder": 8}
    for place in snapshot.people_position_m:
        axes.add_patch(Circle(tuple(place), _PERSON_RADIUS_M, gid="person", **look))
    if not len(snapshot.people_position_m):
        return
    shift = snapshot.people_velocity_mps * _ARROW_PER_SPEED_S
    arrow = {"width": 0.017, "headwidth": 5, "headlength": 5, "headaxislength": 4.5, "zorder": 9}
    named = {"color": style.INK, "gid": "walking direction"}
    draw_vectors(axes, snapshot.people_position_m, shift, **arrow, **named)


def _robot(axes: Axes, pose: FloatArray, radius_m: float) -> None:
    x, y, yaw = pose
    look = {"facecolor": style.ROBOT_COLOUR, "edgecolor": "white", "linewidth": 1.2, "zorder": 10}
    axes.add_patch(Circle((x, y), 1.5 * radius_m, gid="robot", **look))
    nose = 1.4 * radius_m * np.array([np.cos(yaw), np.sin(yaw)])
    axes.plot([x, x + nose[0]], [y, y + nose[1]], color="white", linewidth=2.0, zorder=11)


def _fading_trail(axes: Axes, trail: FloatArray, colour: str, width: float) -> None:
    known = trail[np.isfinite(trail).all(axis=1)]
    if len(known) < 2:
        return
    segments = np.stack([known[:-1], known[1:]], axis=1)
    shades = [to_rgba(colour, alpha) for alpha in np.linspace(0.03, 0.6, len(segments))]
    axes.add_collection(
        LineCollection(list(segments), colors=shades, linewidths=width, zorder=7, capstyle="butt")
    )


def _legend() -> list[Line2D]:
    dot: dict[str, Any] = {"linestyle": "none", "marker": "o", "markeredgecolor": "white"}
    robot, person = style.ROBOT_COLOUR, style.PERSON_COLOUR
    return [
        Line2D([], [], markersize=10, markerfacecolor=robot, label="robot (enlarged)", **dot),
        Line2D(
            [], [], markersize=7, markerfacecolor=person, label="person, arrow = velocity", **dot
        ),
        Line2D([], [], color=person, alpha=0.5, linewidth=1.6, label="the last seconds"),
    ]


def draw_scenario_plan(scenario: Scenario) -> Figure:
    """The empty place in metres; the legend names the loops and how many people walk each."""
    loops = scenario.pedestrians.loops
    with style.report_style():
        figure, axes = map_figure(scenario, width_in=7.3)
        _draw_cells(axes, scenario)
        draw_areas(axes, scenario, filled=True)
        handles = []
        for number, loop in enumerate(loops):
            colour, line = _LOOKS[number % len(_LOOKS)]
            beside_m = _BESIDE_M * (number - 0.5 * (len(loops) - 1))
            _draw_loop(axes, offset_loop(np.array(loop.waypoints_m), beside_m), colour, line)
            label = f"{loop.name} (share {loop.share:g}, lane \u00b1{loop.lane_half_width_m:g} m)"
            handles.append(Line2D([], [], color=colour, linestyle=line, label=label))
        axes.set_title(scenario.name)
        if handles:
            figure.legend(handles=handles, loc="outside lower center", handlelength=2.6)
    return figure


def _draw_cells(axes: Axes, scenario: Scenario) -> None:
    """The grid of decisions as hairlines, where it is not too fine to be seen."""
    cells = scenario.cells
    if cells.walkable.sum() > _LARGEST_GRID:
        return
    squares = cell_squares(cells.centers_m, cells.cell_size_m)
    look: Look = {"facecolor": "none", "edgecolor": style.HAIRLINE, "linewidth": 0.6, "zorder": 1}
    axes.add_collection(PatchCollection(squares, **look))


def _draw_loop(axes: Axes, corners_m: FloatArray, colour: str, line: str) -> None:
    closed = np.vstack([corners_m, corners_m[:1]])
    axes.plot(*closed.T, color=colour, linestyle=line, linewidth=1.3, zorder=4, gid="loop")
    arrow = {"arrowstyle": "-|>", "color": colour, "shrinkA": 0, "shrinkB": 0}
    for start, end in edges_of(corners_m):
        length_m = float(np.hypot(*(end - start)))
        count = max(1, round(length_m / _ARROW_EVERY_M))
        for share in (np.arange(count) + 0.5) / count:
            tip = start + share * (end - start) + 0.2 * (end - start) / length_m
            tail = tip - 0.4 * (end - start) / length_m
            axes.annotate("", xy=tip, xytext=tail, arrowprops=arrow, zorder=5)
