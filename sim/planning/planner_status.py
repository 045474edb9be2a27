"""How a local planner fares, in the words and numbers of Nav2's FollowPath action."""

from enum import IntEnum


class PlannerStatus(IntEnum):
    """NONE is all well; the others are the error codes of nav2_msgs/FollowPath."""

    NONE = 0
    PATIENCE_EXCEEDED = 104
    FAILED_TO_MAKE_PROGRESS = 105
    NO_VALID_CONTROL = 106
