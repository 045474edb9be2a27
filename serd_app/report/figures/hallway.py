"""The hallway at one recorded moment: walls, areas, robot, and people with arrows and trails."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from serd_app.report import style
from serd_app.report.figures.map_axes import HallwayLayout, draw_areas, draw_vectors, map_figure
from serd_app.report.inputs import CrowdSnapshot
from serd_core.arrays import FloatArray

_PERSON_RADIUS_M = 0.22
_ARROW_PER_SPEED_S = 0.7


def draw_hallway(layout: HallwayLayout, snapshot: CrowdSnapshot) -> Figure:
    """Fig. 5.6 with a recorded crowd: arrows show where each person is in 0.7 s at this speed."""
    with style.report_style():
        figure, (axes,) = map_figure(layout, height_in=7.3, width_in=6.4)
        draw_areas(axes, layout, filled=True)
        for trail in np.swapaxes(snapshot.people_trail_m, 0, 1):
            _fading_trail(axes, trail, style.PERSON_COLOUR, width=1.6)
        _fading_trail(axes, snapshot.robot_trail_m, style.ROBOT_COLOUR, width=2.4)
        _people(axes, snapshot)
        _robot(axes, snapshot.robot_pose, layout.robot_radius_m)
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
