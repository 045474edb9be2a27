"""The hallway at one recorded moment: walls, areas, robot, and people with arrows and trails."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from report import style
from report.figures.map_axes import HallwayLayout, draw_areas, draw_vectors, map_figure
from report.inputs import CrowdSnapshot
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
    for x, y in snapshot.people_position_m:
        axes.add_patch(
            Circle(
                (x, y),
                _PERSON_RADIUS_M,
                facecolor=style.PERSON_COLOUR,
                edgecolor="white",
                linewidth=0.6,
                zorder=8,
                gid="person",
            )
        )
    if not len(snapshot.people_position_m):
        return
    shift = snapshot.people_velocity_mps * _ARROW_PER_SPEED_S
    draw_vectors(
        axes,
        snapshot.people_position_m,
        shift,
        width=0.017,
        headwidth=5,
        headlength=5,
        headaxislength=4.5,
        color=style.INK,
        zorder=9,
        gid="walking direction",
    )


def _robot(axes: Axes, pose: FloatArray, radius_m: float) -> None:
    x, y, yaw = pose
    axes.add_patch(
        Circle(
            (x, y),
            1.5 * radius_m,
            facecolor=style.ROBOT_COLOUR,
            edgecolor="white",
            linewidth=1.2,
            zorder=10,
            gid="robot",
        )
    )
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
    def dot(colour: str, size: float, label: str) -> Line2D:
        return Line2D(
            [],
            [],
            linestyle="none",
            marker="o",
            markersize=size,
            label=label,
            markerfacecolor=colour,
            markeredgecolor="white",
        )

    trail = Line2D([], [], color=style.PERSON_COLOUR, alpha=0.5, linewidth=1.6)
    trail.set_label("the last seconds")
    return [
        dot(style.ROBOT_COLOUR, 10, "robot (enlarged)"),
        dot(style.PERSON_COLOUR, 7, "person, arrow = velocity"),
        trail,
    ]
