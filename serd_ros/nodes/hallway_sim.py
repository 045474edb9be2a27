"""hallway_sim: the PyBullet hallway with its people and its robot, as a ROS 2 node."""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped
from std_srvs.srv import SetBool, Trigger

from serd_app.navigation.settings import NavigationSettings
from serd_files.settings import setting, setting_of
from serd_ros.convert.diagnostics import from_episode_message
from serd_ros.convert.pose import from_goal_area_message
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.endpoints import Endpoints
from serd_ros.endpoints.world.world_topics import LiveLoop, LockstepLoop, WorldPublisher
from serd_ros.endpoints.world.worlds import OtherClocks
from serd_ros.errors import NodeError
from serd_ros.graph.readiness import Readiness
from serd_ros.process.serd_node import SerdNode
from serd_ros.settings import NO_NAMES, FramesConfig, StackConfig
from serd_sim.episodes.episode import EpisodeSettings, EpisodeStart, WorldSettings
from serd_sim.errors import SimError
from serd_sim.scenario.grid import with_goal
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.world import HallwayWorld

#: The robot stands where it was placed up to this distance (m, rad): the physical drive settles.
_SETTLES = 0.01


class HallwaySimConfig(FramesConfig):
    """Parameters of hallway_sim."""

    scenario: str = setting_of(EpisodeSettings, "scenario")
    seed: int = setting_of(EpisodeSettings, "seed")
    people: int = setting(-1, "number of people; -1: as the scenario has it", ge=-1)
    start_area: str = setting_of(WorldSettings, "start_area")
    goal: str = setting_of(NavigationSettings, "goal")
    lockstep: bool = setting_of(StackConfig, "lockstep")
    lockstep_timeout_s: float = setting(
        60.0, "end after this wall time without a command in lock-step", unit="s", gt=0
    )
    real_time_factor: float = setting(1.0, "speed of the world when not in lock-step", gt=0)
    stamped_cmd_vel: bool = setting_of(StackConfig, "stamped_cmd_vel")
    command_timeout_s: float = setting(
        0.2, "stop the robot after this time without a command", unit="s", gt=0, le=0.5
    )
    publish_tf: bool = setting(False, "publish map -> odom -> base_link on tf")
    required_nodes: tuple[str, ...] = setting(NO_NAMES, "reset fails until these nodes subscribe")


class EpisodeRequests:
    """Serves `reset`. begin: begins the next episode of the world and returns its start.

    A response may be late or lost, and the driver then repeats its request. So `reset` responds
    with the same episode again until the driver marks it or the robot moves. Where no node
    publishes marks, each request begins the next episode.
    """

    def __init__(
        self,
        endpoints: Endpoints,
        required_nodes: Sequence[str],
        world: HallwayWorld,
        begin: Callable[[], EpisodeStart],
    ) -> None:
        node = self._node = endpoints.node
        self._world, self._begin = world, begin
        #: The last response, until the driver publishes a mark of it.
        self._begun: EpisodeStart | None = None
        self._start_pose = (0.0, 0.0, 0.0)
        self._readiness = Readiness(node, required_nodes, node.wall_s())
        endpoints.serve(Trigger, topics.RESET, self._on_reset)
        endpoints.subscribe(DiagnosticArray, topics.EPISODE, self._on_mark, qos.LOSSLESS)

    @property
    def _is_new_request(self) -> bool:
        """Whether a request is no repetition of one that was answered."""
        x_m, y_m, yaw_rad = np.subtract(self._world.observation.pose, self._start_pose).tolist()
        moved = max(abs(x_m), abs(y_m), abs(math.remainder(yaw_rad, math.tau)))
        return moved > _SETTLES or self._node.count_publishers(topics.EPISODE) == 0

    def _on_reset(self, _: Trigger.Request) -> str:
        missing = self._readiness.missing(self._node.wall_s())
        if missing:
            raise NodeError(missing)
        if self._begun is None or self._is_new_request:
            self._begun = self._begin()
            self._start_pose = self._world.observation.pose
        return self._begun.model_dump_json()

    def _on_mark(self, message: DiagnosticArray) -> None:
        """A mark of the episode shows that its driver received the response."""
        if self._begun is not None and self._begun.episode == from_episode_message(message).episode:
            self._begun = None


class HallwaySim(SerdNode[HallwaySimConfig]):
    """Holds the world; `reset` begins its next episode, `pause` stops its time."""

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
        self._requests = EpisodeRequests(
            endpoints, config.required_nodes, self._world, self._begin_episode
        )
        endpoints.subscribe(PolygonStamped, topics.GOAL_AREA, self._on_goal, qos.LATCHED)
        self._loop = self._make_loop(publisher.publish)
        endpoints.serve(SetBool, topics.PAUSE, self._on_pause)
        OtherClocks(endpoints, lambda: publisher.n_ticks, self._begin_live)

    def _make_loop(self, publish: Callable[[], None]) -> LockstepLoop | LiveLoop:
        config, endpoints, world = self.config, self.endpoints, self._world
        if config.lockstep:
            return LockstepLoop(endpoints, world, publish, config.lockstep_timeout_s)
        stamped, factor = config.stamped_cmd_vel, config.real_time_factor
        limit_s = config.command_timeout_s
        return LiveLoop(
            endpoints, world, publish, limit_s, stamped=stamped, real_time_factor=factor
        )

    def _begin_live(self) -> None:
        """Begin the first episode, which no driver requests."""
        if self.config.lockstep or self._next_episode:
            return
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

    def _on_pause(self, request: SetBool.Request) -> str:
        self._loop.paused = bool(request.data)
        return "paused" if self._loop.paused else "running"
