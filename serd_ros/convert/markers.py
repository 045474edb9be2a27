"""People, policy arrows, the value map, traps and words as MarkerArray, for RViz."""

import math
from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Point, Vector3
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from serd_core.grid.grid import DIRECTION_VECTORS, Action
from serd_ros.convert.pose import to_pose
from serd_ros.convert.stamp import to_header
from serd_ros.endpoints import topics
from serd_sim.world.observation import People

_ARROW = ColorRGBA(r=0.1, g=0.1, b=0.1, a=0.9)
_TRAP = ColorRGBA(r=0.85, g=0.2, b=0.1, a=0.6)
_PEOPLE = ColorRGBA(r=0.85, g=0.48, b=0.15, a=1.0)
_TEXT = ColorRGBA(r=0.0, g=0.0, b=0.0, a=1.0)
_LOW, _HIGH = np.array([0.93, 0.95, 1.0]), np.array([0.10, 0.35, 0.65])


def to_people_markers(people: People, radius_m: float, time_s: float) -> MarkerArray:
    """All people as one list of balls, and a line to where each will be in a second."""
    bodies = _marker(0, "people", Marker.SPHERE_LIST, time_s)
    bodies.scale = Vector3(x=2.0 * radius_m, y=2.0 * radius_m, z=2.0 * radius_m)
    lines = _marker(0, "velocities", Marker.LINE_LIST, time_s)
    lines.scale = Vector3(x=0.05, y=0.0, z=0.0)
    bodies.color = lines.color = _PEOPLE
    soon_m = people.position_m + people.velocity_mps
    for (x_m, y_m), (soon_x_m, soon_y_m) in zip(people.position_m, soon_m, strict=True):
        here = Point(x=float(x_m), y=float(y_m), z=radius_m)
        bodies.points.append(here)
        lines.points += [here, Point(x=float(soon_x_m), y=float(soon_y_m), z=radius_m)]
    return MarkerArray(markers=[bodies, lines])


def to_policy_markers(
    centers_m: NDArray[np.float64], actions: Sequence[Action], cell_size_m: float, time_s: float
) -> MarkerArray:
    """One arrow per cell, a flat disc where the policy waits. centers_m: (S, 2)."""
    markers, length = [], 0.6 * cell_size_m
    for number, (center, action) in enumerate(zip(centers_m, actions, strict=True)):
        east, north = DIRECTION_VECTORS[action]
        waits = action == Action.WAIT
        marker = _marker(number, "policy", Marker.CYLINDER if waits else Marker.ARROW, time_s)
        tail = center - 0.5 * length * np.array([east, north])
        marker.color = _ARROW
        marker.pose = to_pose((tail[0], tail[1], math.atan2(north, east)))
        size = (0.2, 0.2, 0.02) if waits else (length, 0.08, 0.08)
        marker.scale = Vector3(x=size[0], y=size[1], z=size[2])
        markers.append(marker)
    return MarkerArray(markers=markers)


def to_value_markers(
    centers_m: NDArray[np.float64], value: NDArray[np.float64], cell_size_m: float, time_s: float
) -> MarkerArray:
    """All cells as one list of cubes, darker where the value (S,) is higher."""
    marker = _marker(0, "value", Marker.CUBE_LIST, time_s)
    size = float(0.98 * cell_size_m)
    marker.scale = Vector3(x=size, y=size, z=0.01)
    low, high = float(np.min(value)), float(np.max(value))
    shares = (value - low) / (high - low) if high > low else np.zeros_like(value)
    for (x_m, y_m), share in zip(centers_m, shares, strict=True):
        marker.points.append(Point(x=float(x_m), y=float(y_m), z=-0.01))
        red, green, blue = (float(c) for c in _LOW + share * (_HIGH - _LOW))
        marker.colors.append(ColorRGBA(r=red, g=green, b=blue, a=0.8))
    return MarkerArray(markers=[marker])


def to_trap_markers(
    centers_m: NDArray[np.float64], cell_size_m: float, time_s: float
) -> MarkerArray:
    """All trap cells (N, 2) as one list of red cubes, in place of those shown before."""
    marker = _marker(0, "traps", Marker.CUBE_LIST, time_s)
    if not len(centers_m):
        marker.action = Marker.DELETEALL
        return MarkerArray(markers=[marker])
    size = float(0.9 * cell_size_m)
    marker.scale = Vector3(x=size, y=size, z=0.01)
    marker.color = _TRAP
    marker.points = [Point(x=float(x_m), y=float(y_m), z=0.005) for x_m, y_m in centers_m]
    return MarkerArray(markers=[marker])


def to_text_marker(words: str, at_m: tuple[float, float], time_s: float) -> MarkerArray:
    """Words that face the viewer, above a point."""
    marker = _marker(0, "words", Marker.TEXT_VIEW_FACING, time_s)
    marker.pose = to_pose((at_m[0], at_m[1], 0.0))
    marker.pose.position.z = 1.2
    marker.scale = Vector3(x=0.0, y=0.0, z=0.4)
    marker.color = _TEXT
    marker.text = words
    return MarkerArray(markers=[marker])


def _marker(number: int, namespace: str, kind: int, time_s: float) -> Marker:
    header = to_header(topics.MAP_FRAME, time_s)
    return Marker(header=header, ns=namespace, id=number, type=kind, action=Marker.ADD)
