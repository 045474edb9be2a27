"""strategy: drives by the learned policy with waypoints and measures times of arrival.

The goal (`goal_pose`, or the parameter `goal`) and the model (the parameter `model`, its file, or
the topic `model` of a learner in the same graph) may change at any time. Planning takes
milliseconds, so callbacks plan directly.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

from geometry_msgs.msg import PoseStamped
from std_msgs.msg import String

from serd_app.navigation.arrival_log import ArrivalRecords
from serd_app.navigation.navigator import Navigator
from serd_core.grid.grid import Action
from serd_files.episode_table import EpisodeResult
from serd_files.errors import USER_ERRORS
from serd_files.files import FileWatch
from serd_files.model_file import ModelFile
from serd_files.yaml_config import yaml_model
from serd_ros.convert.diagnostics import UNCOUNTED
from serd_ros.convert.pose import from_goal_message, to_waypoint_message
from serd_ros.convert.stamp import Jump
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.strategy_reporter import StrategyReporter
from serd_ros.episodes.driver import EpisodeDriverNode
from serd_ros.graph.configs import StrategyConfig
from serd_ros.graph.parameters import accept_changes
from serd_sim.drivers.catalogue import Driver
from serd_sim.episodes.result import ANYWHERE, EpisodeStart
from serd_sim.world.directive import REPEAT_PERIOD_S
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint, heading_to, waypoint_of_intent

_MODEL_CHECK_PERIOD_S = 1.0
_FROM_LEARNER = "model of the learner"


class StrategyNode(EpisodeDriverNode[StrategyConfig]):
    """Steers by `waypoint`: straight ahead in the direction that the policy chooses."""

    needs_people: ClassVar[bool] = False  # the policy depends on the robot's cell alone
    _navigator: Navigator

    def configure(self) -> None:
        """Read the model and plan."""
        super().configure()
        output = Path(self.config.output) if self.config.output else None
        self._records = ArrivalRecords(output)
        self._goal_waits = bool(self.config.goal)
        self._path = self.config.model
        self._watch = FileWatch(self._path)

    def activate(self) -> None:
        """Drive to the goals that come, by the newest model."""
        super().activate()
        self._waypoints = self.create_publisher(PoseStamped, topics.WAYPOINT, qos.STATE)
        self._waypoint: Waypoint | None = None
        if not self.config.lockstep:
            self.create_timer(REPEAT_PERIOD_S, self._repeat_waypoint)
        self._reporter = StrategyReporter(self)
        self.create_subscription(PoseStamped, topics.GOAL_POSE, self._on_goal, qos.COMMAND)
        self.create_subscription(String, topics.MODEL, self._on_model, qos.LATCHED)
        self.create_timer(_MODEL_CHECK_PERIOD_S, self._check_model_file)
        changes = {"goal": self._change_goal, "model": self._change_model}
        self._on_set = accept_changes(self, changes)
        self._reporter.report_plan(self._navigator.strategy, "start", self.wall_s())

    def deactivate(self) -> None:
        """Discard the drive and its prediction; another one needs a goal anew."""
        super().deactivate()
        self._records.discard_prediction()
        self._goal_waits = False
        self.remove_on_set_parameters_callback(self._on_set)

    def make_driver(self) -> Driver:
        """The policy of the model file, towards the goal of the parameters."""
        scenario = self.scenario
        if self.config.people >= 0:
            scenario = scenario.with_pedestrian_count(self.config.people)
        self._navigator = Navigator(scenario, self.config)
        self.scenario = self._navigator.strategy.scenario
        return self._navigator

    def clock_jumped(self, jump: Jump) -> None:
        """A new session discards the prediction and a waiting goal."""
        if jump is Jump.BACKWARD:
            self._records.discard_prediction()
            self._reporter.time_s, self._goal_waits = 0.0, False
        super().clock_jumped(jump)

    def steer(self, observation: Observation, action: Action) -> None:
        """Publish the waypoint and the forecast it is based on."""
        grid = self._navigator.strategy.problem.grid
        self._waypoint = waypoint_of_intent(grid, observation, action)
        self._publish_waypoint(observation)
        self._records.note_decision(self._navigator, observation)
        self._reporter.report_decision(self._navigator, observation)

    def _publish_waypoint(self, observation: Observation) -> None:
        """To stand, the place of the robot is its waypoint."""
        here = Waypoint(observation.x_m, observation.y_m)
        waypoint = self._waypoint if self._waypoint is not None else here
        heading_rad = heading_to(waypoint, observation)
        message = to_waypoint_message(waypoint, observation.time_s, heading_rad)
        self._waypoints.publish(message)

    def _repeat_waypoint(self) -> None:
        """Publish the waypoint again with the newest stamp, so that silence means an end."""
        if self.driving and self.observation is not None:
            self._publish_waypoint(self.observation)

    def give_up_reason(self) -> str:
        """The reason of the navigator."""
        return self._navigator.reason

    def episode_ended(self, result: EpisodeResult) -> None:
        """Append prediction and measurement to the log of arrivals; the robot stands."""
        self._records.note_result(result)
        self._waypoint = None
        if not self.config.lockstep and self.observation is not None:
            self._publish_waypoint(self.observation)
        if result.reason:
            self._reporter.report_give_up(result.reason)

    def episode_begun(self) -> None:
        """Stand until the first decision."""
        self._waypoint = None

    @property
    def resets_world(self) -> bool:
        """As the parameter `reset`."""
        return self.config.reset

    def request_episode(self) -> None:
        """Without resets, drive to the waiting goal; the next goal begins an episode otherwise."""
        if self.config.reset:
            super().request_episode()
        elif self._goal_waits:
            self._goal_waits = False
            self.begin_episode(
                EpisodeStart(
                    episode=self.n_finished,
                    seed=self.config.seed,
                    start_area=ANYWHERE,
                    start_s=self._reporter.time_s,
                )
            )
        else:
            self.get_logger().info("waiting for a goal on goal_pose")

    def world_report(self, observation: Observation) -> dict[str, str] | None:
        """Without resets, contacts are not counted per episode."""
        return super().world_report(observation) if self.config.reset else UNCOUNTED

    def save_results(self) -> None:
        """Without resets, only the log of arrivals is written, which has no contacts."""
        if self.config.reset:
            super().save_results()

    def _on_goal(self, message: PoseStamped) -> None:
        x_m, y_m = from_goal_message(message, self.frames)
        try:
            self._replan(lambda: self._navigator.set_goal(x_m, y_m), f"goal ({x_m:g}, {y_m:g})")
            self._start_drive()
        except USER_ERRORS as error:
            self._reporter.report_rejection(error)

    def _change_goal(self, value: Any) -> None:
        self._replan(lambda: self._navigator.set_goal_text(str(value)), f"goal {value!r}")
        self._start_drive()

    def _change_model(self, value: Any) -> None:
        self._replan(lambda: self._navigator.set_model(str(value)), f"model {value}")
        self._path, self._watch = str(value), FileWatch(str(value))

    def _check_model_file(self) -> None:
        path = self._path
        if self._watch.changed():
            self._try(lambda: self._navigator.set_model(path), f"{path} read again")

    def _on_model(self, message: String) -> None:
        """Use the model that a learner in the same graph has just learned."""
        self._try(
            lambda: self._navigator.use_model(
                yaml_model(message.data, ModelFile, name=_FROM_LEARNER), _FROM_LEARNER
            ),
            _FROM_LEARNER,
        )

    def _try(self, change: Callable[[], None], what: str) -> None:
        try:
            self._replan(change, what)
        except USER_ERRORS as error:
            self._reporter.report_rejection(error)

    def _replan(self, change: Callable[[], None], what: str) -> None:
        began_s = self.wall_s()
        change()
        self._records.discard_prediction()
        self.set_scenario(self._navigator.strategy.scenario)
        self._reporter.report_plan(self._navigator.strategy, what, began_s)

    def _start_drive(self) -> None:
        """Without resets, a goal begins an episode unless one is running."""
        if self.config.reset or self.driving:
            return
        self._goal_waits = True
        if self.ready:
            self.request_episode()
