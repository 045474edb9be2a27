"""The topics of a robot: where it is, what it observes, the scans of its lidar, its commands.

A node that was stopped finds the commands that waited for it. By the time of their arrival they
would be new, so the time counts at which the middleware sent them, and only the newest one waits.
"""

import math
import os
import time
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import QoSProfile
from sensor_msgs.msg import LaserScan

from serd_ros.convert import motion
from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.convert.sensors import from_scan, scan_geometry_of
from serd_ros.convert.stamp import Jump, StampClock
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.followed_topic import PeopleTopic, follow_transforms, when_placed
from serd_ros.errors import MessageError
from serd_ros.graph.graph import LOOPBACK_PROFILE, PROFILE_VARIABLE
from serd_ros.process.serd_node import Endpoints
from serd_ros.settings import LidarConfig, LocalisationConfig, ObservationConfig
from serd_sim.safety.scan import Scan
from serd_sim.world.command import Command
from serd_sim.world.observation import Observation, ObservationInbox, People

#: Without an observation for this time (s) what is missing is reported.
_SILENCE_S = 2.5
_LOOK_PERIOD_S = 0.5
_LOG_PERIOD_S = 5.0
#: Observations of a robot that come sooner than this share of a control period are left out.
_SOONEST = 0.8
_USUAL = ObservationConfig()


class ObservationSource:
    """Calls back with every observation whose parts have arrived, and reports what is missing.

    on_jump: called before the observation that shows that the clock jumped; FORWARD: what was
    received before is stale, BACKWARD: a new session begins. Late observations are left out.
    config: without a topic of people for the node that publishes them. needs_people: False for
    nodes that find people without their topic, or need none.
    """

    def __init__(
        self,
        endpoints: Endpoints,
        control_period_s: float,
        callback: Callable[[Observation], None],
        config: LocalisationConfig = _USUAL,
        *,
        on_jump: Callable[[Jump], None] = lambda _: None,
        needs_people: bool = True,
    ) -> None:
        tolerance_s = config.stamp_tolerance_s
        people_topic = config.people_topic if isinstance(config, ObservationConfig) else ""
        node = self._node = endpoints.node
        self._callback, self._on_jump = callback, on_jump
        self._inbox = ObservationInbox(
            control_period_s, needs_people=needs_people, tolerance_s=tolerance_s
        )
        self._tolerance_s = tolerance_s
        self._clock, self._soonest_s = StampClock(), _SOONEST * control_period_s
        self._last_s: float | None = None
        self._received_wall_s = node.wall_s()
        self._came_wall_s: dict[str, float] = {}
        self._is_silent = False
        self._localisation = LOCALISATIONS[config.pose_from](endpoints, self._take_pose)
        endpoints.subscribe(Odometry, topics.ODOM, self._on_odometry, qos.STATE)
        self._people: PeopleTopic | None = None
        if needs_people:
            self._people = PeopleTopic(endpoints, people_topic, self._on_people)
        endpoints.every(_LOOK_PERIOD_S, self._look)

    def _take_pose(self, time_ns: int, pose: motion.PlanarPose) -> None:
        self._came_wall_s["pose"] = self._node.wall_s()
        self._pass_on(self._inbox.take_pose(time_ns, pose))

    def _on_odometry(self, message: Odometry) -> None:
        time_ns, _, speeds = motion.from_odometry(message, self._node.frames)
        self._came_wall_s["odom"] = self._node.wall_s()
        self._pass_on(self._inbox.take_speeds(time_ns, speeds))

    def _on_people(self, time_ns: int, people: People) -> None:
        self._came_wall_s["people"] = self._node.wall_s()
        self._pass_on(self._inbox.take_people(time_ns, people))

    def _pass_on(self, observation: Observation | None) -> None:
        if observation is None:
            return
        since_s = observation.time_s - (-math.inf if self._last_s is None else self._last_s)
        if self._tolerance_s and 0.0 <= since_s < self._soonest_s:
            return
        jump = self._clock.advance(round(observation.time_s * 1e9))
        if jump is Jump.LATE:
            return
        self._last_s, self._received_wall_s = observation.time_s, self._node.wall_s()
        if jump is not Jump.NONE:
            self._on_jump(jump)
        self._callback(observation)

    def _look(self) -> None:
        """Report what is missing in the log and on `diagnostics`, there once more at its end."""
        silent_s = self._node.wall_s() - self._received_wall_s
        missing = self._inbox.missing()
        # Nothing at all comes of a simulator that has not begun or is paused.
        may_wait = not self._tolerance_s and set(missing.values()) <= {None}
        was_silent, self._is_silent = self._is_silent, silent_s > _SILENCE_S and not may_wait
        if not (was_silent or self._is_silent):
            return
        text, level = "", OK
        if self._is_silent:
            text, level = "; ".join(self._missing()) or "nothing has come since", WARN
            if "no publisher" in text and os.environ.get(PROFILE_VARIABLE) == str(LOOPBACK_PROFILE):
                text += "; only this machine is searched, ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET in"
                text += " the environment of serd finds others"
            warning = f"no observation for {silent_s:.0f} s: {text}"
            self._node.get_logger().warning(warning, throttle_duration_sec=_LOG_PERIOD_S)
        values = {"silent_s": silent_s}
        self._node.report(0.0, values, level=level, message=text, part="observation")

    def _missing(self) -> list[str]:
        """What keeps an observation from being made, one phrase each."""
        pose_topic = self._localisation.topic
        people = self._people.name if self._people else ""
        names = {"pose": pose_topic, "odom": topics.ODOM, "people": people}
        found, missing = [], self._inbox.missing()
        fault = self._localisation.fault()
        if fault and "pose" not in missing:
            return [fault]  # the pose there was, beside which other parts are newer
        for part, older_s in missing.items():
            topic = names[part]
            late = "pose" if older_s is not None and older_s < 0 else part
            stopped_s = self._node.wall_s() - self._came_wall_s.get(late, math.inf)
            if older_s is not None and stopped_s > _SILENCE_S:
                fix = "look at what publishes it"
                found.append(f"{names[late]} stopped {stopped_s:.0f} s ago: {fix}")
            elif older_s is not None:
                side = "older" if older_s > 0 else "newer"
                found.append(
                    f"{topic} is {abs(older_s):.3f} s {side} than {pose_topic}; at most"
                    f" stamp_tolerance_s = {self._tolerance_s:g} is allowed"
                )
            elif not self._node.count_publishers(topic):
                found.append(f"{topic} has no publisher")
            elif part == "pose" and fault:
                found.append(fault)
            elif part == "people" and self._people and self._people.fault:
                found.append(self._people.fault)
            else:
                found.append(f"{topic} has a publisher, but no usable message has come")
        return list(dict.fromkeys(found))  # one pose may be missing for two others


def follow_scans(
    endpoints: Endpoints,
    config: LidarConfig,
    take: Callable[[int, Scan], None],
    profile: QoSProfile = qos.SENSOR,
) -> None:
    """Call back with (stamp_ns, scan) of each message of `scan`, whatever its frame is."""
    frames, own = endpoints.node.frames, (config.sensor_x, config.sensor_y, config.sensor_yaw)

    def on_scan(message: LaserScan) -> None:
        time_ns, ranges_m = from_scan(message, frame="")
        frame = message.header.frame_id
        is_own = frames.own(frame) == frames.own(config.scan_frame)
        mount = own if is_own else frames.place(frame, topics.BASE_FRAME, at_ns=time_ns).pose
        take(time_ns, Scan(time_ns * 1e-9, ranges_m, scan_geometry_of(message), mount))

    endpoints.subscribe(
        LaserScan, topics.SCAN, when_placed(endpoints, on_scan, topics.SCAN), profile
    )


TakePose = Callable[[int, motion.PlanarPose], None]


class PoseTopic:
    """`robot_pose` as it comes. topic: what must be published for it."""

    topic: ClassVar[str] = topics.ROBOT_POSE

    def __init__(self, endpoints: Endpoints, take: TakePose) -> None:
        def on_pose(message: PoseStamped) -> None:
            take(*motion.from_pose_stamped(message, endpoints.node.frames))

        follow_transforms(endpoints)
        endpoints.subscribe(PoseStamped, self.topic, on_pose, qos.STATE)

    def fault(self) -> str:
        """Why there is no pose although the topic is published; empty if unknown."""
        return ""


class TransformPose:
    """`base_link` in `map` by /tf, whenever all transforms between them have reached a new time."""

    topic: ClassVar[str] = topics.TF

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


LOCALISATIONS: dict[str, type[PoseTopic | TransformPose]] = {
    "robot_pose": PoseTopic,
    "tf": TransformPose,
}


#: Clocks of machines may differ by this much.
_CLOCKS_AGREE_S = 0.2


class CommandPublisher:
    """Publishes commands of a robot."""

    def __init__(self, endpoints: Endpoints, topic: str, *, stamped: bool) -> None:
        self._frames, self._stamped = endpoints.node.frames, stamped
        self._publisher = endpoints.publisher(_kind(stamped), topic, qos.STATE)

    def publish(self, command: Command, time_s: float) -> None:
        """Send a command. time_s: of the observation that it answers."""
        if self._stamped:
            message = self._frames.prefixed(motion.to_twist_stamped(command, time_s))
            self._publisher.publish(message)
        else:
            self._publisher.publish(motion.to_twist(command))


def follow_commands(
    endpoints: Endpoints, topic: str, take: Callable[[Any, float], None], *, stamped: bool
) -> None:
    """Call back with each command and its age (s) by the clocks of its publisher and this machine.

    The age is 0 where the middleware does not state when a message was sent. A command that was
    sent in the future is dropped with a MessageError, since its age is unknown.
    """

    def take_sent(message: Any, info: Mapping[str, int]) -> None:
        sent_ns = info["source_timestamp"]
        age_s = (time.time_ns() - sent_ns) * 1e-9 if sent_ns > 0 else 0.0
        if age_s < -_CLOCKS_AGREE_S:
            raise MessageError(
                f"commands must be sent at most {_CLOCKS_AGREE_S:g} s in the future",
                f"{-age_s:.1f} s",
                "set the clocks of the machines",
            )
        take(message, max(age_s, 0.0))

    endpoints.subscribe(_kind(stamped), topic, take_sent, qos.NEWEST)


def _kind(stamped: bool) -> type[Twist | TwistStamped]:
    return TwistStamped if stamped else Twist
