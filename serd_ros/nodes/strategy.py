"""strategy: drives by the learned policy with waypoints and measures times of arrival.

Goal (`goal_pose`, or the parameter `goal`) and model (the parameter `model`, or the file itself)
may change at any time; a learner in the same graph changes the model too, by its topic `model`. A
plan takes milliseconds, so callbacks make it where they are.
"""

import sys
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import PoseStamped
from std_msgs.msg import String

from serd_app.navigation.arrival_records import ArrivalRecords
from serd_app.navigation.navigator import Navigator
from serd_core.errors import SerdError
from serd_core.grid.grid import Action
from serd_ros.convert.goal import from_goal_message
from serd_ros.convert.pose import to_waypoint_message
from serd_ros.display.strategy_reporter import StrategyVoice
from serd_ros.endpoints import qos, topics
from serd_ros.episodes.driver import EpisodeDriverNode
from serd_ros.episodes.goal_episodes import UNCOUNTED, GoalEpisodes
from serd_ros.parameters.configs import StrategyConfig
from serd_ros.parameters.params import accept_changes
from serd_ros.process.run_node import run_node
from sim.drivers.catalogue import Driver
from sim.world.observation import Observation
from storage.episode_table import EpisodeResult
from storage.files import FileWatch
from storage.model_file import ModelFile
from storage.yaml_config import yaml_model

_LOOK_AT_MODEL_S = 1.0
_FROM_LEARNER = "model of the learner"


class StrategyNode(EpisodeDriverNode[StrategyConfig]):
    """Steers by `waypoint`: the centre of the cell the policy wants next."""

    _navigator: Navigator

    def __init__(self) -> None:
        super().__init__("strategy", StrategyConfig)
        self._records = ArrivalRecords(self.config.output)
        self._by_goal = GoalEpisodes(self.config.seed, wanted=bool(self.config.goal))
        self._path = self.config.model
        self._watch = FileWatch(self._path)
        self._waypoints = self.create_publisher(PoseStamped, topics.WAYPOINT, qos.STATE)
        self._voice = StrategyVoice(self)
        self.create_subscription(PoseStamped, topics.GOAL_POSE, self._on_goal, qos.COMMAND)
        self.create_subscription(String, topics.MODEL, self._on_model, qos.LATCHED)
        self.create_timer(_LOOK_AT_MODEL_S, self._look_at_model, clock=self.wall_clock)
        accept_changes(self, {"goal": self._change_goal, "model": self._change_model})
        self._voice.tell_plan(self._navigator.strategy, "start", self.wall_s())

    def make_driver(self) -> Driver:
        """The policy of the model file, towards the goal of the parameters."""
        self._navigator = Navigator(self.scenario, self.config)
        self.scenario = self._navigator.strategy.scenario
        return self._navigator

    def steer(self, observation: Observation, action: Action) -> None:
        """Publish the waypoint, and what it was decided on."""
        waypoint = self._navigator.waypoint_of(observation, action)
        self._waypoints.publish(to_waypoint_message(waypoint, observation.time_s))
        self._records.note(self._navigator, observation)
        self._voice.tell_decision(self._navigator, observation)

    def give_up_reason(self) -> str:
        """The navigator's, in words."""
        gave_up = self._navigator.gave_up
        return gave_up.value if gave_up is not None else ""

    def episode_ended(self, result: EpisodeResult) -> None:
        """Append prediction and measurement to the log of arrivals."""
        self._records.ended(result)
        if result.reason:
            self._voice.tell_give_up(result.reason)

    def missing_for_episode(self) -> str:
        """Without resets an episode needs a goal, which is waited for elsewhere."""
        return super().missing_for_episode() if self.config.reset else ""

    def ask_for_episode(self) -> None:
        """Without resets drive to the goal that waits; where none does, the next one begins."""
        if self.config.reset:
            super().ask_for_episode()
        elif self._by_goal.wanted:
            self.begin_episode(self._by_goal.begin(self._voice.time_s))
        else:
            self.get_logger().info("waiting for a goal on goal_pose")

    def world_report(self, observation: Observation) -> dict[str, str] | None:
        """Without resets nobody counts contacts per episode."""
        return super().world_report(observation) if self.config.reset else UNCOUNTED

    def save_results(self) -> None:
        """Without resets there is only the log of arrivals, which has no contacts."""
        if self.config.reset:
            super().save_results()

    def _on_goal(self, message: PoseStamped) -> None:
        try:
            x_m, y_m = from_goal_message(message)
            self._replan(lambda: self._navigator.set_goal(x_m, y_m), f"goal ({x_m:g}, {y_m:g})")
            self._go()
        except SerdError as error:
            self._voice.tell_refusal(error)

    def _change_goal(self, value: Any) -> None:
        self._replan(lambda: self._navigator.set_goal_text(str(value)), f"goal {value!r}")
        self._go()

    def _change_model(self, value: Any) -> None:
        self._replan(lambda: self._navigator.set_model(str(value)), f"model {value}")
        self._path, self._watch = str(value), FileWatch(str(value))

    def _look_at_model(self) -> None:
        path = self._path
        if self._watch.changed():
            self._try(lambda: self._navigator.set_model(path), f"{path} read again")

    def _on_model(self, message: String) -> None:
        """What a learner in the same graph has just learned."""
        self._try(
            lambda: self._navigator.use_model(
                yaml_model(message.data, ModelFile, name=_FROM_LEARNER), _FROM_LEARNER
            ),
            _FROM_LEARNER,
        )

    def _try(self, change: Callable[[], None], what: str) -> None:
        try:
            self._replan(change, what)
        except SerdError as error:
            self._voice.tell_refusal(error)

    def _replan(self, change: Callable[[], None], what: str) -> None:
        began_s = self.wall_s()
        change()
        self._records.renew()
        self.aim(self._navigator.strategy.scenario)
        self._voice.tell_plan(self._navigator.strategy, what, began_s)

    def _go(self) -> None:
        """Without resets a goal begins an episode, unless one is under way."""
        if self.config.reset or self.driving:
            return
        self._by_goal.want()
        if self.ready:
            self.ask_for_episode()


def main() -> int:
    """Entry point of `ros2 run serd_ros strategy`."""
    return run_node(StrategyNode)


if __name__ == "__main__":
    sys.exit(main())
