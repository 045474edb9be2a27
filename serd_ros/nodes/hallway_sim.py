"""hallway_sim: the PyBullet hallway with its people and its robot, as a ROS 2 node.

Its world is advanced in lock-step, or by a timer. In lock-step it waits for the TwistStamped whose
stamp is that of its last tick, so a seed gives one trajectory whatever the speed of the machine.
Messages can be lost while endpoints are still being matched, so a tick that stays unanswered is
sent again; receivers answer a known stamp with the same message. A robot in its goal stands and is
not waited for.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped, PoseStamped, Twist, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan, PointCloud2
from std_msgs.msg import String
from std_srvs.srv import Trigger

from serd_app.navigation.settings import NavigationSettings
from serd_bag.files import read_text
from serd_files.settings import setting, setting_of
from serd_ros.convert import motion
from serd_ros.convert.diagnostics import ERROR, OK, from_episode_message
from serd_ros.convert.sensors import to_occupancy_grid, to_people_message, to_scan
from serd_ros.convert.stamp import stamp_ns, to_stamp
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.followed_topic import TransformPublisher, publish_links
from serd_ros.endpoints.robot import follow_commands
from serd_ros.errors import NodeError
from serd_ros.graph.graph import Readiness, several_worlds
from serd_ros.process.serd_node import SerdNode
from serd_ros.settings import NO_NAMES, FramesConfig, StackConfig
from serd_sim.episodes.episode import EpisodeSettings, EpisodeStart, WorldSettings
from serd_sim.errors import SimError
from serd_sim.robot.urdf import link_transforms
from serd_sim.scenario.grid import with_goal
from serd_sim.scenario.occupancy import occupancy_raster
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import CommandGuard
from serd_sim.world.world import HallwayWorld

_RESEND_AFTER_S = 0.5
#: A longer time (s) between two calls of `_watch` is no silence of the driver: this process got no
#: processor time and could receive no command.
_LONGEST_TURN_S = 2.0
#: Simulated time (s) between two reports of contacts that do not change.
_REPORT_PERIOD_S = 0.5
#: The robot stands where it was placed up to this distance (m, rad): the physical drive settles.
_SETTLES = 0.01
_LOOK_PERIOD_S = 1.0
#: The middleware names the publishers of a killed process for 20 s.
_LONGEST_END_S = 25.0


class HallwaySimConfig(FramesConfig):
    """Parameters of hallway_sim."""

    scenario: str = setting_of(EpisodeSettings, "scenario")
    seed: int = setting_of(EpisodeSettings, "seed")
    people: int = setting(-1, "number of people; -1: as the scenario has it", ge=-1)
    start_area: str = setting_of(WorldSettings, "start_area")
    goal: str = setting_of(NavigationSettings, "goal")
    lockstep: bool = setting_of(StackConfig, "lockstep")
    lockstep_timeout_s: float = setting(60.0, "end without commands", unit="s", gt=0)
    real_time_factor: float = setting(1.0, "speed of the world when not in lock-step", gt=0)
    stamped_cmd_vel: bool = setting_of(StackConfig, "stamped_cmd_vel")
    command_timeout_s: float = setting(0.2, "stop without commands", unit="s", gt=0, le=0.5)
    publish_tf: bool = setting(False, "publish map -> odom -> base_link on tf")
    required_nodes: tuple[str, ...] = setting(NO_NAMES, "reset fails until these nodes subscribe")


class HallwaySim(SerdNode[HallwaySimConfig]):
    """Holds the world; `reset` begins its next episode, live the first one begins by itself.

    While another node publishes a world, it does not begin: after 25 s it ends. A response of
    `reset` may be late or lost, and the driver then repeats its request. So it responds with the
    same episode again until the driver marks it or the robot moves. Where no node publishes marks,
    each request begins the next episode.
    """

    config_class = HallwaySimConfig

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        config, endpoints = self.config, self.endpoints
        scenario = load_scenario(config.scenario)
        if config.people >= 0:
            scenario = scenario.with_pedestrian_count(config.people)
        scenario = with_goal(scenario, config.goal)
        self._world = HallwayWorld(scenario, seed=config.seed)
        self.at_end.callback(self._world.close)
        self._next_episode = 0
        publisher = WorldPublisher(self, self._world)
        #: The last response, until the driver publishes a mark of it.
        self._begun: EpisodeStart | None = None
        self._start_pose = (0.0, 0.0, 0.0)
        self._readiness = Readiness(self, config.required_nodes, self.wall_s())
        endpoints.serve(Trigger, topics.RESET, self._on_reset)
        endpoints.subscribe(DiagnosticArray, topics.EPISODE, self._on_mark, qos.LOSSLESS)
        endpoints.subscribe(PolygonStamped, topics.GOAL_AREA, self._on_goal, qos.LATCHED)
        loop = LockstepLoop if config.lockstep else LiveLoop
        self._loop = loop(self, self._world, publisher.publish)
        self._several, self._until_s = "", self.wall_s() + _LONGEST_END_S
        endpoints.every(_LOOK_PERIOD_S, self._look_for_other_worlds)

    @property
    def _is_new_request(self) -> bool:
        """Whether a request is no repetition of one that was answered."""
        x_m, y_m, yaw_rad = np.subtract(self._world.observation.pose, self._start_pose).tolist()
        moved = max(abs(x_m), abs(y_m), abs(math.remainder(yaw_rad, math.tau)))
        return moved > _SETTLES or self.count_publishers(topics.EPISODE) == 0

    def _on_reset(self, _: Trigger.Request) -> str:
        if missing := self._readiness.missing(self.wall_s()):
            raise NodeError(missing)
        if self._begun is None or self._is_new_request:
            self._begun = self._begin_episode()
            self._start_pose = self._world.observation.pose
        return self._begun.model_dump_json()

    def _on_mark(self, message: DiagnosticArray) -> None:
        """A mark of the episode shows that its driver received the response."""
        if self._begun is not None and self._begun.episode == from_episode_message(message).episode:
            self._begun = None

    def _look_for_other_worlds(self) -> None:
        """Begin a live world that is alone; report another one when that changes."""
        several = several_worlds(self)
        if not self._next_episode:
            if not several and not self.config.lockstep:
                self._begin_live()
            elif several and self.wall_s() > self._until_s:
                self.fail(f"there must be {several}")
        if several != self._several:
            self._several = several
            level, message = (ERROR, f"there must be {several}") if several else (OK, "")
            self.report(0.0, {}, level=level, message=message, part="clock")
            if several:
                self.get_logger().error(message)

    def _begin_live(self) -> None:
        with suppress(SimError):  # which has ended the node
            self._begin_episode()
            scenario = self._world.scenario
            self.get_logger().info(
                f"{scenario.name} with {scenario.pedestrians.count} people, seed"
                f" {self.config.seed}; commands come from {self.resolve_topic_name(topics.CMD_VEL)}"
            )

    def _begin_episode(self) -> EpisodeStart:
        """Begin the next episode; SimError where there can be none, which ends the node."""
        episode = self._next_episode
        try:
            self._world.reset(episode, self.config.start_area)
        except SimError as error:
            self.fail(str(error))
            raise
        self._next_episode += 1
        seed, area, start_s = self.config.seed, self.config.start_area, self._world.time_s
        self._loop.begin()
        return EpisodeStart(episode=episode, seed=seed, start_area=area, start_s=start_s)

    def _on_goal(self, message: PolygonStamped) -> None:
        """Set the goal of the driver: where its episode ends and it is no longer waited for."""
        own = self._world.scenario.goal_area_m
        self._world.goal_area_m = motion.from_goal_area_message(message, own)
        self._loop.look()


class WorldPublisher:
    """Publishes the present tick; the scan only to subscribers."""

    def __init__(self, node: HallwaySim, world: HallwayWorld) -> None:
        self._node, self._world, endpoints = node, world, node.endpoints
        self._clock = endpoints.publisher(Clock, topics.CLOCK, qos.CLOCK)
        self._pedestrians = endpoints.publisher(PointCloud2, topics.PEDESTRIANS, qos.STATE)
        self._odometry = endpoints.publisher(Odometry, topics.ODOM, qos.STATE)
        self._pose = endpoints.publisher(PoseStamped, topics.ROBOT_POSE, qos.STATE)
        period_s = world.scenario.control_period_s
        self._ticks_per_report = max(1, round(_REPORT_PERIOD_S / period_s))
        self._reported: dict[str, float] | None = None
        self._scan = endpoints.publisher(LaserScan, topics.SCAN, qos.STATE)
        self._transforms = TransformPublisher(endpoints) if node.config.publish_tf else None
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
        odometry = motion.to_odometry(observation, world.odometry_pose)
        self._odometry.publish(self._node.frames.prefixed(odometry))
        # The last one: with it the subscribers have the observation of this tick.
        self._pose.publish(motion.to_pose_stamped(observation.pose, observation.time_s))

    def _counts(self) -> dict[str, float]:
        """Contacts and distances of the running episode."""
        return {
            **asdict(self._world.contacts),
            "minimum_person_distance_m": self._world.minimum_person_distance_m,
            "rejected_commands": self._world.n_rejected_commands,
        }


class LockstepLoop:
    """One step per stamped command; without one for `lockstep_timeout_s` the node ends."""

    def __init__(self, node: HallwaySim, world: HallwayWorld, publish: Callable[[], None]) -> None:
        self._node, self._world, self._publish = node, world, publish
        self._timeout_s = node.config.lockstep_timeout_s
        self._begun = False
        self._awaited_ns: int | None = None
        self._sent_wall_s = self._watched_wall_s = self._node.wall_s()
        #: How long the command was awaited since the begin of the tick.
        self._silent_s = 0.0
        node.endpoints.subscribe(TwistStamped, topics.CMD_VEL, self._on_command, qos.COMMAND)
        node.endpoints.every(_RESEND_AFTER_S / 2, self._watch)

    def begin(self) -> None:
        """Publish the first observation of the episode and wait for its command."""
        self._begun = True
        self._begin_tick()

    def look(self) -> None:
        """Go on where the robot stood in its goal and the goal has moved away."""
        if self._begun and self._awaited_ns is None and not self._world.in_goal:
            self._begin_tick()

    def _on_command(self, message: TwistStamped) -> None:
        time_ns, command = motion.from_twist_stamped(message)
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

    def __init__(self, node: HallwaySim, world: HallwayWorld, publish: Callable[[], None]) -> None:
        config, endpoints = node.config, node.endpoints
        self._world, self._publish, self._running = world, publish, False
        self._guard = CommandGuard(config.command_timeout_s)
        follow_commands(endpoints, topics.CMD_VEL, self._take, stamped=config.stamped_cmd_vel)
        period_s = world.scenario.control_period_s / config.real_time_factor
        endpoints.every(period_s, self._step)

    def begin(self) -> None:
        """Publish the first observation; the timer continues from here."""
        self._running = True
        self._publish()

    def look(self) -> None:
        """Nothing to do: a live world waits for no robot."""

    def _take(self, message: Twist | TwistStamped, age_s: float) -> None:
        """Let a command reach the guard."""
        self._guard.receive(motion.from_any_twist(message), self._world.time_s - age_s)

    def _step(self) -> None:
        if self._running:
            self._world.step(self._guard.current(self._world.time_s))
            self._publish()
