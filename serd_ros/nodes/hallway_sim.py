"""hallway_sim: the PyBullet hallway with its people and its robot, as a ROS 2 node."""

import math
from collections.abc import Callable
from contextlib import suppress

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped
from std_srvs.srv import Trigger

from serd_app.navigation.settings import NavigationSettings
from serd_files.settings import setting, setting_of
from serd_ros.convert.diagnostics import ERROR, OK, from_episode_message
from serd_ros.convert.motion import from_goal_area_message
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.world_topics import LiveLoop, LockstepLoop, WorldPublisher
from serd_ros.errors import NodeError
from serd_ros.graph.graph import Readiness, several_worlds
from serd_ros.process.serd_node import SerdNode
from serd_ros.settings import NO_NAMES, FramesConfig, StackConfig
from serd_sim.episodes.episode import EpisodeSettings, EpisodeStart, WorldSettings
from serd_sim.errors import SimError
from serd_sim.scenario.grid import with_goal
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.world import HallwayWorld

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
        publisher = WorldPublisher(endpoints, self._world, with_tf=config.publish_tf)
        #: The last response, until the driver publishes a mark of it.
        self._begun: EpisodeStart | None = None
        self._start_pose = (0.0, 0.0, 0.0)
        self._readiness = Readiness(self, config.required_nodes, self.wall_s())
        endpoints.serve(Trigger, topics.RESET, self._on_reset)
        endpoints.subscribe(DiagnosticArray, topics.EPISODE, self._on_mark, qos.LOSSLESS)
        endpoints.subscribe(PolygonStamped, topics.GOAL_AREA, self._on_goal, qos.LATCHED)
        self._loop = self._make_loop(publisher.publish)
        self._several, self._until_s = "", self.wall_s() + _LONGEST_END_S
        endpoints.every(_LOOK_PERIOD_S, self._look_for_other_worlds)

    def _make_loop(self, publish: Callable[[], None]) -> LockstepLoop | LiveLoop:
        config, endpoints, world = self.config, self.endpoints, self._world
        if config.lockstep:
            return LockstepLoop(endpoints, world, publish, config.lockstep_timeout_s)
        stamped, factor = config.stamped_cmd_vel, config.real_time_factor
        limit_s = config.command_timeout_s
        return LiveLoop(
            endpoints, world, publish, limit_s, stamped=stamped, real_time_factor=factor
        )

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
        with suppress(SimError):  # with which the node ends
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
        self._world.goal_area_m = from_goal_area_message(message, own)
        self._loop.look()
