"""The topics of a simulated robot, and what advances its world: lock-step, or a timer.

In lock-step the world waits for the TwistStamped whose stamp is that of its last tick, so a seed
gives one trajectory whatever the speed of the machine. Messages can be lost while endpoints are
still being matched, so a tick that stays unanswered is sent again; receivers answer a known stamp
with the same message. A robot in its goal stands and is not waited for.
"""

from collections.abc import Callable

from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan, PointCloud2
from std_msgs.msg import String

from serd_bag.files import read_text
from serd_ros.convert.motion import (
    from_any_twist,
    from_twist_stamped,
    to_odometry,
    to_pose_stamped,
)
from serd_ros.convert.sensors import to_occupancy_grid, to_people_message, to_scan
from serd_ros.convert.stamp import stamp_ns, to_stamp
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.endpoints import Endpoints
from serd_ros.endpoints.followed_topic import TransformPublisher, publish_links
from serd_ros.endpoints.robot import follow_commands
from serd_sim.robot.urdf import link_transforms
from serd_sim.scenario.occupancy import occupancy_raster
from serd_sim.world.command import CommandGuard
from serd_sim.world.world import HallwayWorld

_RESEND_AFTER_S = 0.5
#: More (s) between two looks at the silence is none: this process had no processor and could take
#: no command.
_LONGEST_TURN_S = 2.0
#: Simulated time (s) between two reports of contacts that do not change.
_REPORT_PERIOD_S = 0.5


class WorldPublisher:
    """Publishes the present tick; the scan only to subscribers, with_tf: as transforms too."""

    def __init__(self, endpoints: Endpoints, world: HallwayWorld, *, with_tf: bool) -> None:
        self._node, self._world = endpoints.node, world
        self._clock = endpoints.publisher(Clock, topics.CLOCK, qos.CLOCK)
        self._pedestrians = endpoints.publisher(PointCloud2, topics.PEDESTRIANS, qos.STATE)
        self._odometry = endpoints.publisher(Odometry, topics.ODOM, qos.STATE)
        self._pose = endpoints.publisher(PoseStamped, topics.ROBOT_POSE, qos.STATE)
        period_s = world.scenario.control_period_s
        self._ticks_per_report = max(1, round(_REPORT_PERIOD_S / period_s))
        self._reported: dict[str, float] | None = None
        self._scan = endpoints.publisher(LaserScan, topics.SCAN, qos.STATE)
        self._transforms = TransformPublisher(endpoints) if with_tf else None
        self._map = endpoints.publisher(OccupancyGrid, topics.MAP, qos.LATCHED)
        self._map.publish(to_occupancy_grid(occupancy_raster(world.scenario), 0.0))
        path = world.scenario.robot.urdf_path
        publish_links(endpoints, link_transforms(path, topics.BASE_FRAME))
        description = endpoints.publisher(String, topics.ROBOT_DESCRIPTION, qos.LATCHED)
        description.publish(String(data=read_text(path)))

    def publish(self) -> None:
        """Send the present tick: the clock, then what the robot observes."""
        world, observation = self._world, self._world.observation
        self._clock.publish(Clock(clock=to_stamp(world.time_s)))
        if world.is_scan_tick and self._scan.get_subscription_count():
            scan = to_scan(world.scan(observation), world.scenario.lidar, observation.time_s)
            self._scan.publish(self._node.frames.prefixed(scan))
        is_due = observation.tick % self._ticks_per_report == 0 or world.in_goal
        counts = self._counts()
        if is_due or counts != self._reported:  # at each change, so those of a tick are known
            self._reported = counts
            self._node.report(world.time_s, counts)
        if self._transforms is not None:
            self._transforms.publish(observation.pose, world.odometry_pose, observation.time_s)
        self._pedestrians.publish(to_people_message(observation.people, observation.time_s))
        odometry = to_odometry(observation, world.odometry_pose)
        self._odometry.publish(self._node.frames.prefixed(odometry))
        # The last one, since it is what people wait for.
        self._pose.publish(to_pose_stamped(observation.pose, observation.time_s))

    def _counts(self) -> dict[str, float]:
        """Contacts and distances of the running episode."""
        contacts = self._world.contacts
        return {
            "robot_on_person": contacts.robot_on_person,
            "person_on_robot": contacts.person_on_robot,
            "robot_on_wall": contacts.robot_on_wall,
            "minimum_person_distance_m": self._world.minimum_person_distance_m,
            "rejected_commands": self._world.n_rejected_commands,
        }


class LockstepLoop:
    """One step per stamped command; without one for timeout_s the node ends."""

    def __init__(
        self,
        endpoints: Endpoints,
        world: HallwayWorld,
        publish: Callable[[], None],
        timeout_s: float,
    ) -> None:
        self._node, self._world = endpoints.node, world
        self._publish, self._timeout_s = publish, timeout_s
        self._begun = False
        self._awaited_ns: int | None = None
        self._sent_wall_s = self._watched_wall_s = self._node.wall_s()
        #: How long the command was awaited since the begin of the tick.
        self._silent_s = 0.0
        endpoints.subscribe(TwistStamped, topics.CMD_VEL, self._on_command, qos.COMMAND)
        endpoints.every(_RESEND_AFTER_S / 2, self._watch)

    def begin(self) -> None:
        """Publish the first observation of the episode and wait for its command."""
        self._begun = True
        self._begin_tick()

    def look(self) -> None:
        """Go on from a goal that is none any more."""
        if self._begun and self._awaited_ns is None and not self._world.in_goal:
            self._begin_tick()

    def _on_command(self, message: TwistStamped) -> None:
        time_ns, command = from_twist_stamped(message)
        if time_ns != self._awaited_ns:
            return
        self._world.step(command)
        self._begin_tick()

    def _begin_tick(self) -> None:
        stamp = stamp_ns(to_stamp(self._world.time_s))
        self._awaited_ns = None if self._world.in_goal else stamp
        self._silent_s = 0.0
        self._send()

    def _send(self) -> None:
        self._sent_wall_s = self._node.wall_s()
        self._publish()

    def _watch(self) -> None:
        """Send an unanswered tick again; give up after a long time without an answer."""
        now_s = self._node.wall_s()
        turn_s, self._watched_wall_s = now_s - self._watched_wall_s, now_s
        if self._awaited_ns is None:
            return
        self._silent_s += turn_s if turn_s <= _LONGEST_TURN_S else 0.0
        if self._silent_s > self._timeout_s:
            self._node.fail(
                f"no command for the tick at {self._world.time_s:.2f} s arrived on"
                f" {self._node.resolve_topic_name(topics.CMD_VEL)} within "
                f"lockstep_timeout_s = {self._timeout_s:g} s; start "
                "local_planner and a driver with lockstep:=true, or run with lockstep:=false"
            )
        elif now_s - self._sent_wall_s > _RESEND_AFTER_S:
            self._send()


class LiveLoop:
    """One step per control period of scaled real time; without a command the robot stops."""

    def __init__(
        self,
        endpoints: Endpoints,
        world: HallwayWorld,
        publish: Callable[[], None],
        timeout_s: float,
        *,
        stamped: bool,
        real_time_factor: float,
    ) -> None:
        self._world, self._publish = world, publish
        self._guard = CommandGuard(timeout_s)
        self._running = False
        follow_commands(endpoints, topics.CMD_VEL, self._take, stamped=stamped)
        endpoints.every(world.scenario.control_period_s / real_time_factor, self._step)

    def begin(self) -> None:
        """Publish the first observation; the timer continues from here."""
        self._running = True
        self._publish()

    def look(self) -> None:
        """Nothing to do: a live world waits for no robot."""

    def _take(self, message: Twist | TwistStamped, age_s: float) -> None:
        """Let a command reach the guard."""
        self._guard.receive(from_any_twist(message), self._world.time_s - age_s)

    def _step(self) -> None:
        if self._running:
            self._world.step(self._guard.current(self._world.time_s))
            self._publish()
