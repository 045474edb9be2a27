"""Topics that may hold the robot's pose, or the commands that drove it, the likeliest first.

They are recognised by type and name; whether they fit one another is tested in `command_fit`.
"""

import re
from collections.abc import Collection, Iterable
from pathlib import PurePosixPath

from bags.topic import Topic

#: Short names of types, the likeliest first.
_POSE_TYPES = (
    *("Odometry", "PoseWithCovarianceStamped", "PoseStamped", "Pose2D", "Pose2DStamped", "Pose"),
    *("PoseWithCovariance", "TransformStamped", "TFMessage", "tfMessage"),
)
_VELOCITY_TYPES = ("Twist", "TwistStamped", "AckermannDriveStamped", "AckermannDrive")
_NO_POSE = frozenset(
    (
        *("goal", "target", "waypoint", "waypoints", "plan", "path", "initialpose", "initial"),
        *("setpoint", "desired", "reference", "cmd", "command", "lookahead", "carrot", "clicked"),
        *("marker", "markers", "person", "people", "pedestrian", "human", "obstacle", "object"),
        *("camera", "static"),
    )
)
_NO_COMMAND = frozenset(
    (
        *("odom", "odometry", "imu", "gps", "fix", "vicon", "mocap", "covariance"),
        *("measured", "actual", "estimated", "feedback", "state", "status"),
    )
)
_POSE_WORDS = (("odom", "odometry"), ("pose", "localization", "amcl", "base", "robot", "slam"))
_COMMAND_WORDS = (("cmd", "command"), ("drive", "vel", "velocity", "twist", "teleop", "key"))


def pose_candidates(topics: Iterable[Topic]) -> list[Topic]:
    """Those of a type with a pose, whose names do not name a goal or another thing."""
    return _ranked(topics, _POSE_TYPES, _POSE_WORDS, _NO_POSE)


def command_candidates(topics: Iterable[Topic]) -> list[Topic]:
    """Those of a type with a velocity, whose names do not name a measurement."""
    return _ranked(topics, _VELOCITY_TYPES, _COMMAND_WORDS, _NO_COMMAND)


def in_one_namespace(first: str, second: str) -> bool:
    """Whether two topics may be of one robot: the namespace of one begins with the other's."""
    one, other = (str(PurePosixPath(name).parent).rstrip("/") + "/" for name in (first, second))
    return one.startswith(other) or other.startswith(one)


def robot_frames(frames: Collection[str]) -> list[str]:
    """Frames of a robot's body, in any namespace, the likeliest first."""
    usual = ("base_link", "base_footprint", "base", "body", "robot", "base_frame")
    short = {frame: frame.rsplit("/", 1)[-1] for frame in frames}
    return sorted(
        (each for each in frames if short[each] in usual), key=lambda e: usual.index(short[e])
    )


def _ranked(
    topics: Iterable[Topic],
    types: tuple[str, ...],
    words: tuple[tuple[str, ...], ...],
    others: frozenset[str],
) -> list[Topic]:
    """Topics of these types without a word of others: by their words, types and names."""

    def rank(topic: Topic) -> tuple[int, int, int, str]:
        found = _words(topic.name)
        named = next((place for place, each in enumerate(words) if found & set(each)), len(words))
        return named, types.index(_short(topic)), len(topic.name), topic.name

    found = [each for each in topics if _short(each) in types and not _words(each.name) & others]
    return sorted(found, key=rank)


def _short(topic: Topic) -> str:
    return topic.type_name.rsplit("/", 1)[-1]


def _words(name: str) -> set[str]:
    return set(re.findall(r"[a-z]+", name.lower()))
