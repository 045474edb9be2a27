"""Poses, goals, paths, commands: (x, y, yaw) to and from messages (REP 103, 105); markers."""

import math
from collections.abc import Sequence

import numpy as np
import shapely
from geometry_msgs.msg import (
    Point,
    Point32,
    PolygonStamped,
    Pose,
    PoseStamped,
    Quaternion,
    Twist,
    TwistStamped,
    Vector3,
    Vector3Stamped,
)
from nav_msgs.msg import Odometry, Path
from numpy.typing import NDArray
from sensor_msgs.msg import Joy
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from serd_app.navigation.approach import GoalPose
from serd_bag.messages.plain import yaw_of_quaternion
from serd_core.grid.grid import DIRECTION_VECTORS, Action, action_of_direction, direction_of_action
from serd_ros.convert.frames import NO_FRAMES, Frames
from serd_ros.convert.stamp import LARGEST, require_finite, require_frame, stamp_ns, to_header
from serd_ros.endpoints import topics
from serd_ros.errors import MessageError
from serd_sim.safety.motion import STANDING, compose, motion_between
from serd_sim.scenario.grid import Area
from serd_sim.world.command import Command
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint

PlanarPose = tuple[float, float, float]
_UNIT_TOLERANCE = 0.01


def to_quaternion(yaw_rad: float) -> Quaternion:
    """Rotation by `yaw_rad` about the vertical."""
    return Quaternion(x=0.0, y=0.0, z=math.sin(yaw_rad / 2), w=math.cos(yaw_rad / 2))


def to_pose(pose: PlanarPose) -> Pose:
    """(x_m, y_m, yaw_rad) as a geometry_msgs/Pose."""
    place = Point(x=float(pose[0]), y=float(pose[1]), z=0.0)
    return Pose(position=place, orientation=to_quaternion(pose[2]))


def from_pose(message: Pose) -> PlanarPose:
    """(x_m, y_m, yaw_rad) of a geometry_msgs/Pose."""
    x_m, y_m = _position(message)
    turn = message.orientation
    yaw_rad = yaw_of_quaternion(turn.x, turn.y, turn.z, turn.w)
    if not math.isclose(math.hypot(turn.x, turn.y, turn.z, turn.w), 1.0, abs_tol=_UNIT_TOLERANCE):
        received = f"({turn.x}, {turn.y}, {turn.z}, {turn.w})"
        raise MessageError("orientation must be a unit quaternion", received, "normalise it")
    return x_m, y_m, yaw_rad


def from_pose_stamped(message: PoseStamped, frames: Frames = NO_FRAMES) -> tuple[int, PlanarPose]:
    """(stamp_ns, pose in the map)."""
    pose = frames.pose_in(topics.MAP_FRAME, message.header.frame_id, from_pose(message.pose))
    return stamp_ns(message.header.stamp), pose


def to_pose_stamped(pose: PlanarPose, time_s: float) -> PoseStamped:
    """A pose in the map at a time."""
    return PoseStamped(header=to_header(topics.MAP_FRAME, time_s), pose=to_pose(pose))


def to_waypoint_message(waypoint: Waypoint, time_s: float, heading_rad: float = 0.0) -> PoseStamped:
    """A waypoint in the map, stamped with the decision it belongs to."""
    return to_pose_stamped((waypoint.x_m, waypoint.y_m, heading_rad), time_s)


def from_waypoint_message(
    message: PoseStamped, frames: Frames = NO_FRAMES
) -> tuple[int, Waypoint, float | None]:
    """(stamp_ns, waypoint in the map, heading there; None without one)."""
    goal = from_goal_pose(message, frames)
    return stamp_ns(message.header.stamp), Waypoint(goal.x_m, goal.y_m), goal.heading_rad


def odom_in_map(base_in_map: PlanarPose, base_in_odom: PlanarPose) -> PlanarPose:
    """Where the odometry's frame lies, T_map_odom = T_map_base T_odom_base^-1."""
    return compose(base_in_map, motion_between(base_in_odom, STANDING))


def to_odometry(observation: Observation, odometry_pose: PlanarPose) -> Odometry:
    """Odometry at the observation's time. odometry_pose: (x_m, y_m, yaw_rad) in the odom frame."""
    header = to_header(topics.ODOM_FRAME, observation.time_s)
    message = Odometry(header=header, child_frame_id=topics.BASE_FRAME)
    message.pose.pose = to_pose(odometry_pose)
    message.twist.twist.linear.x = float(observation.speed_mps)
    message.twist.twist.angular.z = float(observation.yaw_rate_radps)
    return message


def from_odometry(
    message: Odometry, frames: Frames = NO_FRAMES
) -> tuple[int, PlanarPose, tuple[float, float]]:
    """(stamp_ns, pose of the base in the odom frame, (speed_mps, yaw_rate_radps))."""
    pose = from_pose(message.pose.pose)
    pose = frames.pose_in(topics.ODOM_FRAME, message.header.frame_id, pose)
    speeds = message.twist.twist.linear.x, message.twist.twist.angular.z
    if message.child_frame_id != topics.BASE_FRAME:
        field = "child_frame_id"
        child = frames.place(message.child_frame_id, topics.BASE_FRAME, field=field).pose
        base = motion_between(child, STANDING)
        pose, speeds = compose(pose, base), _speeds_of_base(message.twist.twist, base)
    require_finite("twist", speeds)
    return stamp_ns(message.header.stamp), pose, speeds


def _speeds_of_base(twist: Twist, base: PlanarPose) -> tuple[float, float]:
    """Speed ahead and yaw rate of the base, which is fixed in the frame of the twist."""
    turn_radps = twist.angular.z
    east_mps = twist.linear.x - turn_radps * base[1]
    north_mps = twist.linear.y + turn_radps * base[0]
    return east_mps * math.cos(base[2]) + north_mps * math.sin(base[2]), turn_radps


def from_goal_pose(message: PoseStamped, frames: Frames = NO_FRAMES) -> GoalPose:
    """A goal in the map; one without a heading where its quaternion is not one, as of zeros."""
    turn = message.pose.orientation
    place = *_position(message.pose), 0.0
    x_m, y_m = frames.pose_in(topics.MAP_FRAME, message.header.frame_id, place)[:2]
    if not math.isclose(math.hypot(turn.x, turn.y, turn.z, turn.w), 1.0, abs_tol=_UNIT_TOLERANCE):
        return GoalPose(x_m, y_m)
    return GoalPose(x_m, y_m, from_pose_stamped(message, frames)[1][2])


def to_goal(goal: GoalPose, on_way: Pose) -> Pose:
    """The pose of a goal; with the heading of the way where it has none."""
    pose = to_pose((goal.x_m, goal.y_m, goal.heading_rad or 0.0))
    if goal.heading_rad is None:
        pose.orientation = on_way.orientation
    return pose


def _position(message: Pose) -> tuple[float, float]:
    position = message.position.x, message.position.y
    require_finite("position", position)
    return position


def to_goal_area_message(area_m: Area, time_s: float) -> PolygonStamped:
    """The goal area in the map; its corners are kept in single precision."""
    message = PolygonStamped(header=to_header(topics.MAP_FRAME, time_s))
    message.polygon.points = [Point32(x=float(x), y=float(y), z=0.0) for x, y in area_m]
    return message


def from_goal_area_message(message: PolygonStamped, own_area_m: Area) -> Area:
    """The area of a message; `own_area_m` where it is that one, whose corners may be finer."""
    require_frame(message.header, topics.MAP_FRAME)
    stamp_ns(message.header.stamp)
    area_m = tuple((point.x, point.y) for point in message.polygon.points)
    own = np.asarray(own_area_m, dtype=np.float32)
    if own.shape == (len(area_m), 2) and np.array_equal(own, np.asarray(area_m, np.float32)):
        return own_area_m
    require_finite("points", area_m)
    if len(area_m) < 3 or not shapely.Polygon(area_m).is_valid:
        rule = "points must be at least three corners of a polygon without crossing edges"
        raise MessageError(rule, f"{len(area_m)} points", "publish the corners in order")
    return area_m


def to_path(points_m: NDArray[np.float64], time_s: float) -> Path:
    """(N, 2) points in the map as a path; poses look along the next leg, the last along its own."""
    legs = np.diff(points_m, axis=0)
    yaws = np.arctan2(legs[:, 1], legs[:, 0])
    yaws = np.append(yaws, yaws[-1:] if len(yaws) else [0.0] * len(points_m))
    poses = [
        to_pose_stamped((x, y, yaw), time_s) for (x, y), yaw in zip(points_m, yaws, strict=True)
    ]
    return Path(header=to_header(topics.MAP_FRAME, time_s), poses=poses)


_ARROW = ColorRGBA(r=0.1, g=0.1, b=0.1, a=0.9)
_TEXT = ColorRGBA(r=0.0, g=0.0, b=0.0, a=1.0)
#: Red, green and blue of the lowest and of the highest value.
_LOW, _HIGH = np.array([0.93, 0.95, 1.0]), np.array([0.10, 0.35, 0.65])


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
    """All cells (S, 2) as one list of cubes, darker where the value (S,) is higher."""
    marker = _marker(0, "value", Marker.CUBE_LIST, time_s)
    size = 0.98 * cell_size_m
    marker.scale = Vector3(x=size, y=size, z=0.01)
    shares = (value - value.min()) / max(float(np.ptp(value)), 1e-12)
    colours = _LOW + shares[:, None] * (_HIGH - _LOW)
    marker.points = [Point(x=x_m, y=y_m, z=-0.01) for x_m, y_m in centers_m.tolist()]
    marker.colors = [ColorRGBA(r=r, g=g, b=b, a=0.8) for r, g, b in colours.tolist()]
    return MarkerArray(markers=[marker])


def to_text_marker(words: str, at_m: tuple[float, float], time_s: float) -> MarkerArray:
    """Words that face the viewer, above a point."""
    marker = _marker(0, "words", Marker.TEXT_VIEW_FACING, time_s)
    marker.pose = to_pose((*at_m, 0.0))
    marker.pose.position.z = 1.2
    marker.scale, marker.color, marker.text = Vector3(x=0.0, y=0.0, z=0.4), _TEXT, words
    return MarkerArray(markers=[marker])


def _marker(number: int, namespace: str, kind: int, time_s: float) -> Marker:
    header = to_header(topics.MAP_FRAME, time_s)
    return Marker(header=header, ns=namespace, id=number, type=kind, action=Marker.ADD)


def to_twist(command: Command) -> Twist:
    """A plain Twist, what Nav2 in Jazzy and teleop_twist_keyboard send."""
    message = Twist()
    message.linear.x = float(command.linear_mps)
    message.angular.z = float(command.angular_radps)
    return message


def to_twist_stamped(command: Command, time_s: float) -> TwistStamped:
    """A TwistStamped whose stamp is that of the observation it answers."""
    return TwistStamped(header=to_header(topics.BASE_FRAME, time_s), twist=to_twist(command))


def from_twist(message: Twist) -> Command:
    """The command of a Twist; what a unicycle cannot do (linear.y, ...) is ignored.

    One beyond LARGEST becomes NaN, and one that is not finite stays so: who follows it stops.
    """
    speeds = message.linear.x, message.angular.z
    return Command(*(math.nan if abs(each) > LARGEST else each for each in speeds))


def from_twist_stamped(message: TwistStamped) -> tuple[int, Command]:
    """(stamp_ns, command); an empty frame is the robot's."""
    require_frame(message.header, topics.BASE_FRAME, "")
    return stamp_ns(message.header.stamp), from_twist(message.twist)


def from_any_twist(message: Twist | TwistStamped) -> Command:
    """The command of a message with a stamp or without."""
    is_plain = isinstance(message, Twist)
    return from_twist(message) if is_plain else from_twist_stamped(message)[1]


def to_intent(action: Action, time_s: float) -> Vector3Stamped:
    """The unit direction of an action in the map, (0, 0) to wait."""
    message = Vector3Stamped(header=to_header(topics.MAP_FRAME, time_s))
    message.vector.x, message.vector.y = direction_of_action(action)
    return message


def from_intent(message: Vector3Stamped, frames: Frames = NO_FRAMES) -> tuple[int, Action]:
    """(stamp_ns, action): the action whose axis is nearest to the direction in the map."""
    direction = message.vector.x, message.vector.y
    require_finite("vector", direction)
    if message.header.frame_id != topics.MAP_FRAME:
        matrix = frames.place(message.header.frame_id, topics.MAP_FRAME).matrix
        direction = tuple(matrix[:2, :2] @ direction)
    return stamp_ns(message.header.stamp), action_of_direction(*direction)


def to_joy(axes: Sequence[float], buttons: Sequence[int], time_s: float) -> Joy:
    """A joystick's state as joy_node publishes it."""
    values = {"axes": list(map(float, axes)), "buttons": list(map(int, buttons))}
    return Joy(header=to_header("", time_s), **values)
