"""Observations: pose, speeds and people, put together by stamp; and the scans of a lidar."""

import math
from collections.abc import Callable

from nav_msgs.msg import Odometry
from rclpy.qos import QoSProfile
from sensor_msgs.msg import LaserScan, PointCloud2

from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.convert.pose import PlanarPose, from_odometry
from serd_ros.convert.sensors import from_scan, scan_geometry_of
from serd_ros.convert.stamp import Jump, StampClock
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.endpoints import Endpoints
from serd_ros.endpoints.localisation import LOCALISATIONS
from serd_ros.endpoints.people_topic import PeopleTopic
from serd_ros.settings import LidarConfig, LocalisationConfig, ObservationConfig
from serd_sim.safety.scan import Scan
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
        elif people_topic:  # publishers wait for it, as for those of all nodes
            endpoints.subscribe(PointCloud2, people_topic, lambda _: None, qos.STATE)
        endpoints.every(_LOOK_PERIOD_S, self._look)

    def _take_pose(self, time_ns: int, pose: PlanarPose) -> None:
        self._came_wall_s["pose"] = self._node.wall_s()
        self._pass_on(self._inbox.take_pose(time_ns, pose))

    def _on_odometry(self, message: Odometry) -> None:
        time_ns, pose, speeds = from_odometry(message, self._node.frames)
        self._came_wall_s["odom"] = self._node.wall_s()
        self._pass_on(self._inbox.take_speeds(time_ns, speeds))
        self._localisation.take_odometry(time_ns, pose)

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
        mount = own if is_own else frames.place(frame, topics.BASE_FRAME).pose
        take(time_ns, Scan(time_ns * 1e-9, ranges_m, scan_geometry_of(message), mount))

    endpoints.subscribe(LaserScan, topics.SCAN, on_scan, profile)
