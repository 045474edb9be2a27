"""hallway_sim: the PyBullet hallway with its people and the robot, as a ROS 2 node."""

import sys

from geometry_msgs.msg import PolygonStamped
from std_srvs.srv import SetBool, Trigger

from serd_ros.convert.pose import from_goal_area_message
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.world_loop import LiveLoop, LockstepLoop, WorldLoop
from serd_ros.endpoints.world_publisher import WorldPublisher
from serd_ros.endpoints.worlds import OtherClocks
from serd_ros.graph.configs import HallwaySimConfig
from serd_ros.graph.readiness import Readiness
from serd_ros.process.run_node import run_node
from serd_ros.process.serd_node import SerdNode
from sim.episodes.result import EpisodeStart
from sim.scenario.goal import with_goal
from sim.scenario.scenario import load_scenario
from sim.world.world import HallwayWorld


class HallwaySim(SerdNode[HallwaySimConfig]):
    """Holds the world; `reset` begins its next episode, `pause` stops its time."""

    def __init__(self) -> None:
        super().__init__("hallway_sim", HallwaySimConfig)
        scenario = load_scenario(self.config.scenario)
        if self.config.people >= 0:
            scenario = scenario.with_pedestrian_count(self.config.people)
        scenario = with_goal(scenario, self.config.goal)
        self._world = HallwayWorld(scenario, seed=self.config.seed, gui=self.config.gui)
        self._publisher = WorldPublisher(self, self._world)
        self._next_episode = 0
        self._readiness = Readiness(self, self.config.required_nodes, self.wall_s())
        loop = LockstepLoop if self.config.lockstep else LiveLoop
        self._loop: WorldLoop = loop(self, self._world, self._publisher)
        self.create_service(Trigger, topics.RESET, self._on_reset)
        self.create_service(SetBool, topics.PAUSE, self._on_pause)
        self.create_subscription(PolygonStamped, topics.GOAL_AREA, self._on_goal, qos.LATCHED)
        OtherClocks(self, lambda: self._publisher.n_clocks, self._begin_live)

    def _begin_live(self) -> None:
        """Begin the first episode, which no driver asks for."""
        if self.config.lockstep or self._next_episode:
            return
        self._begin_episode()
        scenario = self._world.scenario
        self.get_logger().info(
            f"{scenario.name} with {scenario.pedestrians.count} people, seed {self.config.seed};"
            f" the robot follows {topics.CMD_VEL}"
        )

    def close(self) -> None:
        """Close PyBullet's world."""
        self._world.close()

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        missing = self._readiness.missing(self.wall_s())
        response.success = not missing
        response.message = missing or self._begin_episode().model_dump_json()
        return response

    def _begin_episode(self) -> EpisodeStart:
        episode = self._next_episode
        start = self._world.reset(episode, self.config.start_area)
        self._next_episode += 1
        self._loop.begin()
        return EpisodeStart(
            episode=episode,
            seed=self.config.seed,
            start_area=self.config.start_area,
            start_s=start.time_s,
        )

    def _on_goal(self, message: PolygonStamped) -> None:
        """Set the goal of the driver: where an episode ends and a world in lock-step stops."""
        self._world.set_goal(from_goal_area_message(message, self._world.scenario.goal_area_m))
        self._loop.goal_moved()

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._loop.paused = bool(request.data)
        response.success = True
        response.message = "paused" if self._loop.paused else "running"
        return response


def main() -> int:
    """Entry point of `ros2 run serd_ros hallway_sim`."""
    return run_node(HallwaySim)


if __name__ == "__main__":
    sys.exit(main())
