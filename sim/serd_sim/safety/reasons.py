"""The inputs of the guard, what can be wrong with them, and what it does to a command."""

from dataclasses import dataclass
from enum import Enum, IntEnum


class Source(str, Enum):
    """An input of the guard, or its output, by the name of its topic."""

    COMMAND = "cmd_vel_raw"
    ODOMETRY = "odom"
    POSE = "robot_pose"
    PEOPLE = "pedestrians"
    SCAN = "scan"
    CLOCK = "/clock"
    OUTPUT = "cmd_vel"


class Fault(str, Enum):
    """Why the guard changes a command."""

    MISSING = "no message yet"
    STALE = "stamp too old"
    FUTURE = "stamp in the future"
    SLOW = "stamp old or rate low"
    INVALID = "not finite"
    FROZEN = "does not change"
    JUMP = "jump"
    INCONSISTENT = "contradicts odometry"
    UNSEEN = "contradicts the scan"
    TWIST = "twist contradicts the pose"
    BLIND = "too few valid rays"
    LOST_RAYS = "lost rays"
    LOST_SECTOR = "no return where something was in reach"
    NOT_IN_VIEW = "does not look there"
    UNKNOWN = "nothing known ahead"
    SEVERAL = "several publishers"
    COLLISION = "collision ahead"
    FAST = "faster than allowed"
    NEAR = "in the slowdown zone"


class GuardAction(IntEnum):
    """Numbers and names of nav2_msgs/CollisionMonitorState."""

    DO_NOTHING = 0
    STOP = 1
    SLOWDOWN = 2
    APPROACH = 3
    LIMIT = 4


@dataclass(frozen=True)
class Reason:
    """One fault of one input."""

    source: Source
    fault: Fault

    def __str__(self) -> str:
        return f"{self.source.value}: {self.fault.value}"
