"""strategy: drives by the learned policy with waypoints and measures times of arrival.

The goal (topic `goal_pose`) and the model (its file, or the topic `model` of a learner in the same
graph) may change at any time. Planning takes milliseconds, so callbacks plan directly.
"""

import array
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from geometry_msgs.msg import PolygonStamped, PoseStamped
from nav_msgs.msg import Path as PathMessage
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout, String
from visualization_msgs.msg import MarkerArray

from serd_app.navigation.navigator import ArrivalRecords, Navigator, plan_remarks
from serd_app.navigation.settings import NavigationSettings
from serd_core.arrival.law import ArrivalLaw
from serd_core.grid.grid import Action
from serd_files.errors import USER_ERRORS
from serd_files.files import FileWatch
from serd_files.model_file import ModelFile
from serd_files.settings import setting, setting_of
from serd_files.table import EpisodeResult
from serd_files.yaml_config import yaml_model
from serd_ros.convert import motion
from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.episode_runner import EpisodeRunner
from serd_ros.process.serd_node import Activate, Activity, Endpoints, SerdNode
from serd_ros.settings import DriverConfig, StackConfig
from serd_sim.drivers.strategy import Strategy
from serd_sim.episodes.episode import ANYWHERE, EpisodeStart
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import REPEAT_PERIOD_S, Waypoint, heading_to, waypoint_of_intent

_MODEL_CHECK_PERIOD_S = 1.0
_FROM_LEARNER = "model of the learner"


class StrategyConfig(NavigationSettings, DriverConfig):
    """Parameters of strategy."""

    lockstep: bool = setting_of(
        StackConfig, "lockstep", description="the world waits; otherwise waypoints are repeated"
    )
    reset: bool = setting(
        True, "reset the world before each episode; false: a goal starts one where the robot is"
    )
    people: int = setting(-1, "forecast among so many people; -1: the scenario's", ge=-1)


class StrategyNode(SerdNode[StrategyConfig]):
    """Drives while it is active."""

    config_class = StrategyConfig

    def configure(self) -> Activate:
        """Read the model and plan."""
        config, scenario = self.config, load_scenario(self.config.scenario)
        if config.people >= 0:
            scenario = scenario.with_pedestrian_count(config.people)
        navigator, file = Navigator(scenario, config), FileWatch(config.model)
        records = ArrivalRecords(Path(config.output) if config.output else None)
        return partial(Navigating, Plan(navigator, file, records, goal_waits=bool(config.goal)))


@dataclass
class Plan:
    """What a deactivated strategy keeps; goal_waits: whether the goal is still to be driven to."""

    navigator: Navigator
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
        self._waypoints.publish(
            motion.to_waypoint_message(waypoint, observation.time_s, heading_rad)
        )

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
        x_m, y_m = motion.from_goal_message(message, self._node.frames)
        try:
            self._replan(lambda: self._navigator.set_goal(x_m, y_m), f"goal ({x_m:g}, {y_m:g})")
            self._start_drive()
        except USER_ERRORS as error:
            self._reporter.report_rejection(error)

    def _check_model_file(self) -> None:
        path = self._config.model
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


_LOG_PERIOD_S = 5.0
_SMALLEST_STEP = 1e-3


class StrategyReporter:
    """Publishes for a node; all topics but `plan` are latched. time_s: of the last decision."""

    def __init__(self, endpoints: Endpoints) -> None:
        self.time_s = 0.0
        self._node = endpoints.node
        self._goal = endpoints.publisher(PolygonStamped, topics.GOAL_AREA, qos.LATCHED)
        self._arrival = endpoints.publisher(Float64MultiArray, topics.ARRIVAL, qos.LATCHED)
        self._way = endpoints.publisher(PathMessage, topics.PLAN, qos.COMMAND)
        self._arrows = endpoints.publisher(MarkerArray, topics.MARKERS_POLICY, qos.LATCHED)
        self._values = endpoints.publisher(MarkerArray, topics.MARKERS_VALUE, qos.LATCHED)
        self._text = endpoints.publisher(MarkerArray, topics.MARKERS_ARRIVAL, qos.LATCHED)

    def report_plan(self, strategy: Strategy, cause: str, began_s: float) -> None:
        """Publish a new plan and log its remarks; began_s: wall time when planning began."""
        grid, policy = strategy.problem.grid, strategy.policy
        centers_m, size_m, time_s = grid.centers_m, grid.cell_size_m, self.time_s
        self._goal.publish(motion.to_goal_area_message(strategy.scenario.goal_area_m, time_s))
        arrows = [Action(int(each)) for each in policy.greedy]
        self._arrows.publish(motion.to_policy_markers(centers_m, arrows, size_m, time_s))
        self._values.publish(motion.to_value_markers(centers_m, policy.value, size_m, time_s))
        took_ms = 1e3 * (self._node.wall_s() - began_s)
        self._node.get_logger().info(f"{cause}: planned and published in {took_ms:.1f} ms")
        for remark in plan_remarks(strategy):
            self._node.get_logger().warning(remark)

    def report_decision(self, navigator: Navigator, observation: Observation) -> None:
        """Publish the forecast of the last decision; a drive that begins in its goal has none."""
        forecast = navigator.forecast
        if forecast is None:
            return
        self.time_s = forecast.time_s
        self._arrival.publish(to_arrival_message(forecast.law, self.time_s))
        if self._way.get_subscription_count():
            self._way.publish(motion.to_path(navigator.way_m(observation), self.time_s))
        if self._text.get_subscription_count():
            place_m = observation.x_m, observation.y_m
            self._text.publish(motion.to_text_marker(forecast.summary, place_m, self.time_s))
        if forecast.needs_attention:
            self._node.get_logger().warning(
                f"{forecast.situation} at ({observation.x_m:.1f}, {observation.y_m:.1f}) m: "
                f"{forecast.summary}",
                throttle_duration_sec=_LOG_PERIOD_S,
            )
        values = {
            **forecast.values(),
            "n_trap_states": len(navigator.strategy.traps.states),
            "n_least_time_states": int(navigator.strategy.by_time.sum()),
            "transferred": navigator.strategy.transferred,
        }
        level = WARN if forecast.needs_attention else OK
        self._node.report(self.time_s, values, level=level, message=forecast.situation)

    def report_rejection(self, error: Exception) -> None:
        """Report a goal or a model that cannot be used."""
        self._node.get_logger().warning(f"refused, the plan stays: {error}")
        self._node.report(self.time_s, {}, level=WARN, message=f"refused: {error}")

    def report_give_up(self, reason: str) -> None:
        """Report the end of a drive that did not arrive."""
        self._node.report(self.time_s, {"reason": reason}, level=WARN, message="gave up")


def to_arrival_message(law: ArrivalLaw, now_s: float) -> Float64MultiArray:
    """The law of the remaining time as seen at `now_s`, in steps of at least a thousandth.

    Row 0: times (s) on the clock of the observations, the first one being now; row 1: predicted
    probability of having arrived by then, given no arrival so far.
    """
    kept = [0]
    for step in range(1, len(law.cdf)):
        if law.cdf[step] - law.cdf[kept[-1]] >= _SMALLEST_STEP:
            kept.append(step)
    size = len(kept)
    columns = MultiArrayDimension(label="time_s, probability", size=2, stride=2 * size)
    steps = MultiArrayDimension(label="step", size=size, stride=size)
    layout = MultiArrayLayout(dim=[columns, steps], data_offset=0)
    rows = np.concatenate([law.times_s[kept] + now_s, law.cdf[kept]])
    return Float64MultiArray(layout=layout, data=array.array("d", rows.tobytes()))
