"""A goal from geometry_msgs/PoseStamped, as RViz sends it; the goal area in force as a polygon."""

import numpy as np
from geometry_msgs.msg import Point32, PolygonStamped, PoseStamped

from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import topics
from serd_ros.errors import NodeError
from sim.scenario.goal import Area


def from_goal_message(message: PoseStamped) -> tuple[float, float]:
    """(x_m, y_m) of a goal in the map; NodeError for another frame."""
    frame = message.header.frame_id
    if frame != topics.MAP_FRAME:
        raise NodeError(
            f"goal_pose must be in the frame {topics.MAP_FRAME!r}, got {frame!r}"
            "; set RViz's fixed frame to it or transform the goal"
        )
    return message.pose.position.x, message.pose.position.y


def to_goal_area_message(area_m: Area, time_s: float) -> PolygonStamped:
    """The goal area in the map; its corners are kept in single precision."""
    message = PolygonStamped()
    message.header.frame_id = topics.MAP_FRAME
    message.header.stamp = to_stamp(time_s)
    message.polygon.points = [Point32(x=float(x), y=float(y), z=0.0) for x, y in area_m]
    return message


def from_goal_area_message(message: PolygonStamped, own_area_m: Area) -> Area:
    """The area of a message; `own_area_m` where it is that one, whose corners may be finer."""
    area_m = tuple((point.x, point.y) for point in message.polygon.points)
    own = np.asarray(own_area_m, dtype=np.float32)
    if own.shape == (len(area_m), 2) and np.array_equal(own, np.asarray(area_m, np.float32)):
        return own_area_m
    return area_m
