"""strategy: drives by the learned policy with waypoints and measures times of arrival.

The goal (`goal_pose`, or the parameter `goal`) and the model (the parameter `model`, its file, or
the topic `model` of a learner in the same graph) may change at any time. Planning takes
milliseconds, so callbacks plan directly.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from geometry_msgs.msg import PoseStamped
from std_msgs.msg import String

from serd_app.navigation.navigator import ArrivalRecords, Navigator
from serd_app.navigation.settings import NavigationSettings
from serd_core.grid.grid import Action
from serd_files.episode_table import EpisodeResult
from serd_files.errors import USER_ERRORS
from serd_files.files import FileWatch
from serd_files.model_file import ModelFile
from serd_files.settings import setting, setting_of
from serd_files.yaml_config import yaml_model
from serd_ros.convert.pose import from_goal_message, to_waypoint_message
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.endpoints import Endpoints
from serd_ros.endpoints.strategy_reporter import StrategyReporter
from serd_ros.episodes.runner import EpisodeRunner
from serd_ros.process.lifecycle import Activate, Activity, ManagedNode
from serd_ros.settings import DriverConfig, StackConfig
from serd_sim.episodes.episode import ANYWHERE, EpisodeStart
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import REPEAT_PERIOD_S, Waypoint, heading_to, waypoint_of_intent

_MODEL_CHECK_PERIOD_S = 1.0
_FROM_LEARNER = "model of the learner"


class StrategyConfig(NavigationSettings, DriverConfig):
    """Parameters of strategy."""

    changeable: ClassVar[tuple[str, ...]] = ("goal", "model")

    lockstep: bool = setting_of(
        StackConfig,
        "lockstep",
        description="the world waits for every decision; otherwise waypoints are repeated five"
        " times a second, so that the planner stands soon after this node has ended",
    )
    reset: bool = setting(
        True, "reset the world before each episode; false: a goal starts one where the robot is"
    )
    people: int = setting(
        -1,
        "number of people for which times of arrival are predicted; -1: as the scenario has it",
        ge=-1,
    )


class StrategyNode(ManagedNode[StrategyConfig]):
    """Drives while it is active."""

    config_class = StrategyConfig

    def configure(self) -> Activate:
        """Read the model and plan."""
        config, scenario = self.config, load_scenario(self.config.scenario)
        if config.people >= 0:
            scenario = scenario.with_pedestrian_count(config.people)
        navigator, file = Navigator(scenario, config), FileWatch(config.model)
        records = ArrivalRecords(Path(config.output) if config.output else None)
        plan = Plan(navigator, config.model, file, records, goal_waits=bool(config.goal))
        return partial(Navigating, plan)


@dataclass
class Plan:
    """What a deactivated strategy keeps: policy, log of arrivals, results of episodes.

    model, file: of the policy. goal_waits: whether the goal is to be driven to without another one.
    """

    navigator: Navigator
    model: str
    file: FileWatch
    records: ArrivalRecords
    goal_waits: bool
    results: list[EpisodeResult] = field(default_factory=list)


class Navigating(Activity):
    """Steers by `waypoint`: straight ahead in the direction that the policy chooses."""

    def __init__(self, plan: Plan, endpoints: Endpoints) -> None:
        self._node, self._plan = endpoints.node, plan
        config = self._config = endpoints.node.config
        self._navigator, self._records = plan.navigator, plan.records
        self._waypoint: Waypoint | None = None
        self._waypoints = endpoints.publisher(PoseStamped, topics.WAYPOINT, qos.STATE)
        self._reporter = StrategyReporter(endpoints)
        scenario = plan.navigator.strategy.scenario
        self.runner = EpisodeRunner(
            endpoints, config, scenario, plan.navigator, self._steer, plan.results,
            needs_people=False,  # the policy depends on the robot's cell alone
            start=None if config.reset else self._start,
            give_up=lambda: self._navigator.reason,
            on_end=self._on_end,
            on_new_session=self._on_new_session,
        )  # fmt: skip
        if not config.lockstep:
            endpoints.every(REPEAT_PERIOD_S, self._repeat_waypoint)
        endpoints.subscribe(PoseStamped, topics.GOAL_POSE, self._on_goal, qos.COMMAND)
        endpoints.subscribe(String, topics.MODEL, self._on_model, qos.LATCHED)
        endpoints.every(_MODEL_CHECK_PERIOD_S, self._check_model_file)
        endpoints.on_set({"goal": self._change_goal, "model": self._change_model})
        self._reporter.report_plan(self._navigator.strategy, "start", self._node.wall_s())

    def deactivate(self) -> None:
        """Discard the drive and its prediction; another one needs a goal anew."""
        self.runner.discard()
        self._records.discard_prediction()
        self._plan.goal_waits = False

    def _steer(self, observation: Observation, action: Action) -> None:
        """Publish the waypoint and the forecast it is based on."""
        cells = self._navigator.strategy.scenario.cells
        self._waypoint = waypoint_of_intent(cells, observation, action)
        self._publish_waypoint(observation)
        self._records.note_decision(self._navigator, observation)
        self._reporter.report_decision(self._navigator, observation)

    def _publish_waypoint(self, observation: Observation) -> None:
        """To stand, the place of the robot is its waypoint."""
        waypoint = self._waypoint or Waypoint(observation.x_m, observation.y_m)
        heading_rad = heading_to(waypoint, observation)
        self._waypoints.publish(to_waypoint_message(waypoint, observation.time_s, heading_rad))

    def _repeat_waypoint(self) -> None:
        """Publish the waypoint again with the newest stamp, so that silence means an end."""
        if self.runner.driving and self.runner.observation is not None:
            self._publish_waypoint(self.runner.observation)

    def _start(self) -> EpisodeStart | None:
        """Without resets, drive to the waiting goal; the next goal begins an episode otherwise."""
        if not self._plan.goal_waits:
            self._node.get_logger().info("waiting for a goal on goal_pose")
            return None
        self._plan.goal_waits = False
        number, start_s = self.runner.n_finished, self._reporter.time_s
        seed = self._config.seed
        return EpisodeStart(episode=number, seed=seed, start_area=ANYWHERE, start_s=start_s)

    def _on_end(self, result: EpisodeResult) -> None:
        """Append prediction and measurement to the log of arrivals; the robot stands."""
        self._records.note_result(result)
        self._waypoint = None
        if not self._config.lockstep and self.runner.observation is not None:
            self._publish_waypoint(self.runner.observation)
        if result.reason:
            self._reporter.report_give_up(result.reason)

    def _on_new_session(self) -> None:
        """Discard the prediction and a waiting goal."""
        self._records.discard_prediction()
        self._reporter.time_s, self._plan.goal_waits = 0.0, False

    def _on_goal(self, message: PoseStamped) -> None:
        x_m, y_m = from_goal_message(message, self._node.frames)
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
        self._plan.model, self._plan.file = str(value), FileWatch(str(value))

    def _check_model_file(self) -> None:
        path = self._plan.model
        if self._plan.file.changed():
            self._try(lambda: self._navigator.set_model(path), f"{path} read again")

    def _on_model(self, message: String) -> None:
        """Use the model that a learner in the same graph has just learned."""

        def use() -> None:
            file = yaml_model(message.data, ModelFile, name=_FROM_LEARNER)
            self._navigator.use_model(file, _FROM_LEARNER)

        self._try(use, _FROM_LEARNER)

    def _try(self, change: Callable[[], None], what: str) -> None:
        try:
            self._replan(change, what)
        except USER_ERRORS as error:
            self._reporter.report_rejection(error)

    def _replan(self, change: Callable[[], None], what: str) -> None:
        began_s = self._node.wall_s()
        change()
        self._records.discard_prediction()
        self.runner.set_scenario(self._navigator.strategy.scenario)
        self._reporter.report_plan(self._navigator.strategy, what, began_s)

    def _start_drive(self) -> None:
        """Without resets, a goal begins an episode unless one is running."""
        if self._config.reset or self.runner.driving:
            return
        self._plan.goal_waits = True
        if self.runner.ready:
            self.runner.next_episode()
