"""The robot's pose in the map: `robot_pose`, `amcl_pose` carried on by `odom`, or /tf."""

import math
from collections import deque
from collections.abc import Callable
from typing import ClassVar

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped

from serd_ros.convert.pose import PlanarPose, from_pose_stamped
from serd_ros.convert.stamp import Jump, StampClock
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.endpoints import Endpoints
from serd_ros.endpoints.transforms import follow_transforms
from serd_ros.errors import MessageError
from serd_sim.safety.motion import compose, motion_between

#: Messages of odom among which that of the stamp of an amcl_pose is looked up.
_KEPT = 200
#: Motion by odometry alone after an amcl_pose, which comes after far less.
_FARTHEST_M = 1.0
_FARTHEST_RAD = 1.0
TakePose = Callable[[int, PlanarPose], None]


class Localisation:
    """A source of poses. topic: what must be published for it."""

    topic: ClassVar[str]

    def take_odometry(self, time_ns: int, pose: PlanarPose) -> None:
        """Take the pose in the odom frame, after which a pose in the map may follow."""

    def fault(self) -> str:
        """Why there is no pose although the topic is published; empty if unknown."""
        return ""


class PoseTopic(Localisation):
    """`robot_pose` as it comes."""

    topic = topics.ROBOT_POSE

    def __init__(self, endpoints: Endpoints, take: TakePose) -> None:
        def on_pose(message: PoseStamped) -> None:
            take(*from_pose_stamped(message, endpoints.node.frames))

        follow_transforms(endpoints)
        endpoints.subscribe(PoseStamped, self.topic, on_pose, qos.STATE)


class AmclPose(Localisation):
    """`amcl_pose`, which comes rarely, carried on by each odometry since its stamp.

    After 1 m or 1 rad of odometry without an `amcl_pose` there is no pose until the next one.
    """

    topic = topics.AMCL_POSE

    def __init__(self, endpoints: Endpoints, take: TakePose) -> None:
        self._frames, self._take_pose = endpoints.node.frames, take
        self._odometry: deque[tuple[int, PlanarPose]] = deque(maxlen=_KEPT)
        self._clock = StampClock()
        self._found: tuple[int, PlanarPose] | None = None
        #: The odometry nearest to its stamp, which may still be under way when it comes.
        self._matched: tuple[int, PlanarPose] | None = None
        self._is_lost = False
        follow_transforms(endpoints)
        endpoints.subscribe(PoseWithCovarianceStamped, self.topic, self._on_pose, qos.LATCHED)

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        self._found, self._is_lost = from_pose_stamped(message, self._frames), False
        if self._odometry:
            found_ns = self._found[0]
            self._matched = min(self._odometry, key=lambda each: abs(each[0] - found_ns))

    def take_odometry(self, time_ns: int, pose: PlanarPose) -> None:
        """Carry the last `amcl_pose` on; after a clock that fell back, wait for the next one."""
        jump = self._clock.advance(time_ns)
        if jump is Jump.LATE:
            return
        if jump is Jump.BACKWARD:
            self._odometry.clear()
            self._found = self._matched = None
        self._odometry.append((time_ns, pose))
        if self._found is None:
            return
        found_ns = self._found[0]
        if self._matched is None or abs(time_ns - found_ns) < abs(self._matched[0] - found_ns):
            self._matched = time_ns, pose
        motion = motion_between(self._matched[1], pose)
        if math.hypot(*motion[:2]) > _FARTHEST_M or abs(motion[2]) > _FARTHEST_RAD:
            self._is_lost, self._found, self._matched = True, None, None
            return
        self._take_pose(time_ns, compose(self._found[1], motion))

    def fault(self) -> str:
        """That the last `amcl_pose` is too far back."""
        if not self._is_lost:
            return ""
        return (
            f"odom has moved more than {_FARTHEST_M:g} m or {_FARTHEST_RAD:g} rad since the last"
            " amcl_pose; look at the localisation"
        )


class TransformPose(Localisation):
    """`base_link` in `map` by /tf, as often as the transform next to `base_link` comes."""

    topic = topics.TF

    def __init__(self, endpoints: Endpoints, take: TakePose) -> None:
        self._frames, self._take_pose = endpoints.node.frames, take
        self._last_ns: int | None = None
        follow_transforms(endpoints, self._on_change)

    def _on_change(self) -> None:
        try:
            placed = self._frames.place(topics.BASE_FRAME, topics.MAP_FRAME)
        except MessageError:
            return
        if placed.stamp_ns is not None and placed.stamp_ns != self._last_ns:
            self._last_ns = placed.stamp_ns
            self._take_pose(placed.stamp_ns, placed.pose)

    def fault(self) -> str:
        """What /tf lacks."""
        try:
            placed = self._frames.place(topics.BASE_FRAME, topics.MAP_FRAME)
        except MessageError as error:
            return str(error)
        return "" if placed.stamp_ns is not None else "base_link does not move in map by /tf"


LOCALISATIONS: dict[str, Callable[[Endpoints, TakePose], Localisation]] = {
    "robot_pose": PoseTopic,
    "amcl_pose": AmclPose,
    "tf": TransformPose,
}
