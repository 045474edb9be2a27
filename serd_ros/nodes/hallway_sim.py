"""hallway_sim: the PyBullet hallway with its people and robots, as a ROS 2 node.

Several robots have a node each in this process, with the same name in the robot's namespace; the
clock and `pause` are those of the world.
"""

from std_srvs.srv import SetBool

from serd_ros.endpoints import topics
from serd_ros.endpoints.world.simulated_robot import SimulatedRobot
from serd_ros.endpoints.world.world_loop import LiveLoop, LockstepLoop, WorldLoop
from serd_ros.endpoints.world.world_publisher import ClockPublisher
from serd_ros.endpoints.world.worlds import OtherClocks
from serd_ros.errors import NodeError
from serd_ros.graph.configs import HallwaySimConfig
from serd_ros.graph.graph import full_namespace
from serd_ros.graph.readiness import Readiness
from serd_ros.process.serd_node import SerdNode
from sim.episodes.result import EpisodeStart
from sim.errors import SimError
from sim.scenario.goal import with_goal
from sim.scenario.scenario import load_scenario
from sim.world.shared_world import SharedWorld, sharable


class HallwaySim(SerdNode[HallwaySimConfig]):
    """Holds the world; `reset` begins its next episode, `pause` stops its time.

    With several robots an episode begins when the driver of each has asked for it.
    """

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        names = [name for each in self.config.robots if (name := full_namespace(each))]
        self._check_names(names)
        scenario = load_scenario(self.config.scenario)
        if self.config.people >= 0:
            scenario = scenario.with_pedestrian_count(self.config.people)
        scenario = with_goal(scenario, self.config.goal)
        n_robots = max(1, len(names))
        if n_robots > 1 and (shared := sharable(scenario)) is not scenario:
            drive = shared.robot.drive
            self.get_logger().info(f"robots that share a world drive by `drive: {drive}`")
            scenario = shared
        self._world = SharedWorld(
            scenario, seed=self.config.seed, robots=n_robots, gui=self.config.gui
        )
        self._next_episode = 0
        self._clock_publisher = ClockPublisher(self)
        self._clock_readiness = Readiness(self, (), self.wall_s())
        nodes = [self._node_in(name) for name in names] or [self]
        self._robots = [
            SimulatedRobot(node, world, on_ask=self._begin_when_all_asked, on_goal=self._look)
            for node, world in zip(nodes, self._world.worlds, strict=True)
        ]
        loop = LockstepLoop if self.config.lockstep else LiveLoop
        self._loop: WorldLoop = loop(self, self._clock_publisher, self._world, self._robots)
        self.serve(SetBool, topics.PAUSE, self._on_pause)
        OtherClocks(self, lambda: self._clock_publisher.n_sent, self._begin_live)

    def _check_names(self, names: list[str]) -> None:
        if len(set(names)) < len(names):
            raise NodeError(f"robots must be different names, got {', '.join(names)}; rename one")
        if names and self.get_namespace() != "/":
            raise NodeError(
                "where robots are given, hallway_sim must have no namespace, got"
                f" {self.get_namespace()}; write it before the name of each robot"
            )
        if names and self.frames.prefix:
            raise NodeError(
                "frame_prefix must be empty where robots are given, each of which has its own, got"
                f" {self.frames.prefix!r}; leave it out"
            )

    def _node_in(self, namespace: str) -> SerdNode[HallwaySimConfig]:
        """The node of a robot."""
        given = {"frame_prefix": f"{namespace.strip('/')}/"}
        node: SerdNode[HallwaySimConfig] = SerdNode(self.kind, namespace, given)
        self.add_companion(node)
        return node

    def _begin_live(self) -> None:
        """Begin the first episode, which no driver requests."""
        if self.config.lockstep or self._next_episode:
            return
        if self._begin_episode():
            return
        scenario = self._world.worlds[0].scenario
        names = ", ".join(each.command_topic for each in self._robots)
        self.get_logger().info(
            f"{scenario.name} with {scenario.pedestrians.count} people, seed {self.config.seed};"
            f" commands come from {names}"
        )

    def close(self) -> None:
        """Close PyBullet's world."""
        self._world.close()

    def _begin_when_all_asked(self) -> str:
        """What an episode waits for; empty where it has begun."""
        missing = self._clock_readiness.missing(self.wall_s())
        others = [each for each in self._robots if each.is_waited_for]
        if others:
            self._look()
            return f"the driver of {', '.join(each.name for each in others)}"
        return missing or self._begin_episode()

    def _begin_episode(self) -> str:
        """Begin the next episode; why there can be none, which ends the node, else empty."""
        episode = self._next_episode
        try:
            self._world.reset(episode, self.config.start_area)
        except SimError as error:
            self.fail(str(error))
            return str(error)
        self._next_episode += 1
        start = EpisodeStart(
            episode=episode,
            seed=self.config.seed,
            start_area=self.config.start_area,
            start_s=self._world.time_s,
        )
        for robot in self._robots:
            robot.begin(start)
        self._loop.begin()
        return ""

    def _look(self) -> None:
        self._loop.look()

    def _on_pause(self, request: SetBool.Request) -> str:
        self._loop.paused = bool(request.data)
        return "paused" if self._loop.paused else "running"
