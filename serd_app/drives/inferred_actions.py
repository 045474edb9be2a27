"""What somebody meant who sent no intents: actions from velocity commands or from waypoints.

Velocity: a command holds until the next, at most `hold_s`; turned by the robot's heading and
averaged over a decision period it is the direction asked for, WAIT below `minimum_speed_mps`.
In a period in which no command holds nothing was asked for, which need not mean to wait.
Waypoint: the direction from the robot to it, WAIT where it is nearer than `reached_m`.
"""

import numpy as np

from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.grid.grid import Action, action_of_direction


def actions_of_velocities(
    *,
    decision_time_s: FloatArray,
    period_s: float,
    command_time_s: FloatArray,
    command_mps: FloatArray,
    pose_time_s: FloatArray,
    yaw_rad: FloatArray,
    hold_s: float = 0.5,
    minimum_speed_mps: float = 0.05,
) -> tuple[IntArray, BoolArray]:
    """(N,) action of the period that begins at each decision time, (N,) whether a command held.

    command_mps (C, 2): forward and left in the robot's frame; yaw_rad (T,) at pose_time_s.
    """
    yaw = np.interp(command_time_s, pose_time_s, np.unwrap(yaw_rad))
    cos, sin = np.cos(yaw), np.sin(yaw)
    east = cos * command_mps[:, 0] - sin * command_mps[:, 1]
    north = sin * command_mps[:, 0] + cos * command_mps[:, 1]
    until_s = np.minimum(np.append(command_time_s[1:], np.inf), command_time_s + hold_s)
    actions, heard = [], []
    for start_s in decision_time_s:
        held_s = np.minimum(until_s, start_s + period_s) - np.maximum(command_time_s, start_s)
        heard.append(bool((held_s > 0.0).any()))
        share = np.maximum(held_s, 0.0) / period_s
        actions.append(_action(float(share @ east), float(share @ north), minimum_speed_mps))
    return np.array(actions, dtype=np.int64), np.array(heard, dtype=bool)


def actions_of_waypoints(
    *, position_m: FloatArray, waypoint_m: FloatArray, reached_m: float
) -> IntArray:
    """(N,) action for the robot at (N, 2) sent to the waypoints (N, 2)."""
    offsets = waypoint_m - position_m
    actions = [_action(float(east), float(north), reached_m) for east, north in offsets]
    return np.array(actions, dtype=np.int64)


def _action(east: float, north: float, least: float) -> Action:
    length = float(np.hypot(east, north))
    if length < least or length == 0.0:
        return Action.WAIT
    return action_of_direction(east / length, north / length)
