"""strategy: drives by the learned policy with waypoints and measures times of arrival.

Goals come by the action `navigate_to_pose` or the topic `goal_pose`, and the model (its file, or
the topic `model` of a learner in the same graph) may come and change at any time. The first plan
and those in lock-step are made in callbacks. Live, others and laws of arrival are made in threads,
for the newest goal alone; the present plan is driven meanwhile. A drive arrives in the cell of its
goal; from there the robot goes on to the pose of the goal.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from geometry_msgs.msg import PolygonStamped, PoseStamped
from nav_msgs.msg import Path as PathMessage
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from serd_app.navigation.approach import FinalApproach, GoalPose
from serd_app.navigation.navigator import ArrivalRecords, Navigator, Wanted, plan_remarks
from serd_app.navigation.newest_job import NewestJob
from serd_app.navigation.settings import ApproachSettings, NavigationSettings
from serd_core.grid.grid import Action
from serd_files.errors import USER_ERRORS
from serd_files.files import FileWatch
from serd_files.model_file import ModelFile, load_model
from serd_files.settings import setting, setting_of
from serd_files.table import EpisodeResult
from serd_files.yaml_config import yaml_model
from serd_ros.convert import motion, typed
from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.endpoints import navigate_action as action
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.episode_runner import EpisodeRunner
from serd_ros.endpoints.navigate_action import ActionGoal
from serd_ros.endpoints.planning_services import PlanningServices, timed_path
from serd_ros.endpoints.topic_types import TYPES
from serd_ros.errors import MessageError
from serd_ros.process.serd_node import Activate, Activity, Endpoints, SerdNode
from serd_ros.settings import DriverConfig, StackConfig
from serd_sim.drivers.strategy import Strategy
from serd_sim.episodes.episode import ANYWHERE, EpisodeStart
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import REPEAT_PERIOD_S, Waypoint, heading_to, waypoint_of_intent

_MODEL_CHECK_PERIOD_S = 1.0
_FROM_LEARNER = "model of the learner"
_ATTEND_PERIOD_S, _FEEDBACK_PERIOD_S = 0.02, 0.2
#: The law of arrival may take seconds; what drives the robot goes before.
_LAW_NICENESS = 10


class StrategyConfig(ApproachSettings, NavigationSettings, DriverConfig):
    """Parameters of strategy."""

    lockstep: bool = setting_of(
        StackConfig, "lockstep", description="the world waits; otherwise waypoints are repeated"
    )
    reset: bool = setting(
        True, "reset the world before each episode; false: a goal starts one where the robot is"
    )
    people: int = setting(-1, "forecast among so many people; -1: the scenario's", ge=-1)
    action: str = setting(
        topics.NAVIGATE_TO_POSE,
        "without resets: name of the action server for goals, none when empty",
    )


class StrategyNode(SerdNode[StrategyConfig]):
    """Drives while it is active."""

    config_class = StrategyConfig

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        name = "" if self.config.reset else self.config.action
        self.server = action.navigate_to_pose_server(self, name, self.callbacks)
        self._navigator: Navigator | None = None

    def configure(self) -> Activate:
        """Read the scenario; the model may come later."""
        config, scenario = self.config, load_scenario(self.config.scenario)
        if config.people >= 0:
            scenario = scenario.with_pedestrian_count(config.people)
        navigator = self._navigator = Navigator(scenario, config, waits_for_law=not config.lockstep)
        records = ArrivalRecords(Path(config.output) if config.output else None)
        file = FileWatch(config.model)
        return partial(Navigating, Plan(navigator, file, records, goal_waits=bool(config.goal)))

    def take_change(self, config: StrategyConfig) -> None:
        """Give up drives by the parameters that were set; goals are reached by them at once."""
        if self._navigator is not None:
            self._navigator.change(config)


@dataclass
class Plan:
    """What a deactivated strategy keeps; goal_waits: whether the goal is still to be driven to."""

    navigator: Navigator
    file: FileWatch
    records: ArrivalRecords
    goal_waits: bool
    results: list[EpisodeResult] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Goal:
    """A goal; client: whose action it is, None of one from a topic; pose: None of an early one."""

    message: PoseStamped
    client: ActionGoal | None
    pose: GoalPose | None = None

    def end(self, how: action.Ending, reason: str = "", code: int = 0) -> None:
        """Let the client know."""
        if self.client is not None:
            self.client.end(how, reason, code)


#: A plan that was made, with its line in the log and when it was begun by wall time (s).
Planned = tuple[Wanted, Strategy, str, float]
#: A goal in a frame that /tf has not had yet, one that is being planned for, that of the drive.
Stage = Literal["early", "asked", "driven"]


class Navigating(Activity):
    """Steers by `waypoint`: straight ahead in the direction that the policy chooses."""

    def __init__(self, plan: Plan, endpoints: Endpoints) -> None:
        self._node, self._plan = endpoints.node, plan
        config = self._config = endpoints.node.config
        self._navigator, self._records = plan.navigator, plan.records
        self._waypoint: Waypoint | None = None
        #: Of the last decision.
        self._decided_at: Observation | None = None
        self._goals = dict[Stage, Goal]()
        self._approach: FinalApproach | None = None
        self._plans, self._laws = NewestJob(), NewestJob(niceness=_LAW_NICENESS)
        self._fed_back_wall_s = 0.0
        #: The plan whose law is known or being computed.
        self._law_of: Strategy | None = None
        self._waypoints = endpoints.publisher(PoseStamped, topics.WAYPOINT, qos.STATE)
        self._reporter = StrategyReporter(endpoints)
        #: Why there is no plan, while there is none.
        path = Path(config.model).absolute()
        self._lack = f"the model file {path}, or a model on the topic {topics.MODEL}"
        scenario = plan.navigator.wanted.scenario
        self.runner = EpisodeRunner(
            endpoints, config, scenario, plan.navigator, self._steer, plan.results,
            needs_people=False,  # the policy depends on the robot's cell alone
            start=None if config.reset else self._start,
            give_up=lambda: self._navigator.reason,
            on_end=self._on_end,
            on_new_session=self._on_new_session,
            lack=lambda: "" if self._navigator.has_plan else self._lack,
        )  # fmt: skip
        if not config.lockstep:
            endpoints.every(REPEAT_PERIOD_S, self._repeat_waypoint)
        endpoints.every(_ATTEND_PERIOD_S, self._attend)
        endpoints.subscribe(PoseStamped, topics.GOAL_POSE, self._on_goal, qos.COMMAND)
        endpoints.subscribe(String, topics.MODEL, self._on_model, qos.LATCHED)
        endpoints.every(_MODEL_CHECK_PERIOD_S, self._check_model_file)
        PlanningServices(endpoints, plan.navigator, lambda: self.runner.observation)
        if (server := endpoints.node.server) is not None:
            server.taken, server.check = lambda goal: self._take_goal(goal.pose, goal), self._check
        if self._navigator.has_plan:  # of an earlier activity
            self._reporter.report_plan(self._navigator.strategy, "start", self._node.wall_s())
        self._check_model_file()

    def deactivate(self) -> None:
        """Discard the drive and its prediction; another one needs a goal anew."""
        self.close()
        self.runner.discard()
        self._records.discard_prediction()
        self._plan.goal_waits = False

    def close(self) -> None:
        """Take no more goals and end those that are there."""
        if self._node.server is not None:
            self._node.server.taken = None
        self._end_goals("the strategy ends")

    def _steer(self, observation: Observation, action: Action) -> None:
        """Publish the waypoint and the forecast it is based on."""
        self._begin_law()
        cells = self._navigator.strategy.scenario.cells
        self._waypoint = waypoint_of_intent(cells, observation, action)
        self._publish_waypoint(observation)
        self._decided_at = observation
        self._reporter.report_way(self._navigator, observation, self._goal_of_drive)
        self._take_forecast()

    def _take_forecast(self) -> None:
        """Record and publish the forecast of the last decision, where there is one."""
        if self._decided_at is not None and self._navigator.forecast is not None:
            self._records.note_decision(self._navigator, self._decided_at)
            self._reporter.report_decision(self._navigator, self._decided_at)

    def _publish_waypoint(self, observation: Observation) -> None:
        """To stand, the place of the robot is its waypoint."""
        waypoint = self._waypoint or Waypoint(observation.x_m, observation.y_m)
        heading_rad = heading_to(waypoint, observation)
        self._waypoints.publish(
            motion.to_waypoint_message(waypoint, observation.time_s, heading_rad)
        )

    def _repeat_waypoint(self) -> None:
        """Publish the waypoint again with the newest stamp, so that silence means an end."""
        observation = self.runner.observation
        if observation is None:
            return
        if self.runner.driving:
            self._publish_waypoint(observation)
        elif self._approach is not None:
            self._go_on(self._approach, observation)

    def _go_on(self, approach: FinalApproach, observation: Observation) -> None:
        """From the goal cell to the pose of the goal."""
        step = approach.step(observation)
        if step is None:
            self._approach = None
            self._publish_waypoint(observation)
            if approach.failed:
                self._reporter.report_give_up(approach.failed)
            how: action.Ending = "abort" if approach.failed else "succeed"
            code = action.PATIENCE_EXCEEDED * bool(approach.failed)
            self._end_goal("driven", how, approach.failed, code)
            return
        waypoint, heading_rad = step
        self._waypoints.publish(
            motion.to_waypoint_message(waypoint, observation.time_s, heading_rad)
        )

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
        """Append prediction and measurement to the log of arrivals; the robot stands or goes on."""
        self._records.note_result(result)
        self._waypoint = self._decided_at = None
        if result.reason:
            self._reporter.report_give_up(result.reason)
        if not self._config.lockstep:
            self._stand_or_approach(result)

    def _stand_or_approach(self, result: EpisodeResult) -> None:
        goal = self._goal_of_drive
        if goal is not None and result.outcome == "arrived":
            self._approach = FinalApproach(goal, self._node.config)
            self._reporter.report_goal(goal)
        elif result.outcome == "arrived":
            self._end_goal("driven", "succeed")
        else:
            self._end_goal(
                "driven", "abort", result.reason or result.outcome, action.PATIENCE_EXCEEDED
            )
        observation = self.runner.observation
        if observation is not None and self._approach is not None:
            self._go_on(self._approach, observation)
        elif observation is not None:
            self._publish_waypoint(observation)

    @property
    def _goal_of_drive(self) -> GoalPose | None:
        """The pose to which the drive leads; None of a goal that is an area."""
        goal = self._goals.get("driven")
        return None if goal is None or self._config.reset else goal.pose

    def _on_new_session(self) -> None:
        """Discard the prediction and the goals."""
        self._records.discard_prediction()
        self._reporter.time_s, self._plan.goal_waits = 0.0, False
        self._end_goals("the clock fell back")

    def _on_goal(self, message: PoseStamped) -> None:
        self._take_goal(message, None)

    def _take_goal(self, message: PoseStamped, client: ActionGoal | None) -> None:
        """Plan for a goal; one in a frame of a robot whose /tf has not come yet waits for it."""
        self._end_goal("early", "abort", "a newer goal came")
        try:
            pose = self._pose_of(message)
        except MessageError as error:
            if client is None:
                raise
            client.end("abort", str(error), action.TF_ERROR)
            self._reporter.report_rejection(error)
            return
        if pose is None:
            self._goals["early"] = Goal(message, client)
            self._node.get_logger().info(f"the goal in {message.header.frame_id} waits for /tf")
            return
        want = partial(self._navigator.want_goal, pose.x_m, pose.y_m)
        self._ask(want, f"goal ({pose.x_m:g}, {pose.y_m:g})", Goal(message, client, pose))

    def _pose_of(self, message: PoseStamped) -> GoalPose | None:
        """The pose of a goal; None of an early one, which may be sound once /tf has come."""
        place, frames = message.pose.position, self._node.frames
        try:
            return motion.from_goal_pose(message, frames)
        except MessageError:
            if message.header.frame_id and math.isfinite(place.x + place.y) and not frames.names:
                return None
            raise

    def _check(self, message: PoseStamped) -> None:
        """Raise a SerdError for a goal to which no plan can lead; an early one is checked later."""
        if (pose := self._pose_of(message)) is not None:
            self._navigator.check_goal(pose.x_m, pose.y_m, self.runner.observation)

    def _check_model_file(self) -> None:
        path, had_plan = self._config.model, self._navigator.has_plan
        if self._plan.file.changed():
            what = f"{path} read" + " again" * had_plan
            self._ask(lambda: self._navigator.want_model(load_model(path), path), what)
        if self._navigator.has_plan:
            self._reporter.show_policy(self._navigator.strategy)
        else:
            self._node.report(0.0, {}, level=WARN, message=f"waiting for {self._lack}")

    def _on_model(self, message: String) -> None:
        """Use the model that a learner in the same graph has just learned."""

        def use() -> None:
            file = yaml_model(message.data, ModelFile, name=_FROM_LEARNER)
            self._navigator.want_model(file, _FROM_LEARNER)

        self._ask(use, _FROM_LEARNER)

    def _ask(self, want: Callable[[], None], what: str, goal: Goal | None = None) -> None:
        """Plan for what is wanted from now on; goal: to which a drive leads then."""
        try:
            want()
        except USER_ERRORS as error:
            if goal is None:
                self._refuse_model(error)
            else:
                goal.end("abort", str(error), action.GOAL_OUTSIDE_MAP)
                self._reporter.report_rejection(error)
            return
        if goal is not None:
            self._end_goal("asked", "abort", "a newer goal came")
            self._goals["asked"] = goal
        wanted, began_s = self._navigator.wanted, self._node.wall_s()
        if wanted.file is None:
            self._node.get_logger().info(f"{what} waits for a model")
            return

        def planned() -> Planned:
            return wanted, self._navigator.solve(wanted), what, began_s

        if self._navigator.has_plan and not self._config.lockstep:
            self._plans.begin(planned)
            return
        try:
            self._take_plan(*planned())
        except USER_ERRORS as error:
            self._refuse_plan(error)

    def _attend(self) -> None:
        """Take what threads have done, and look after the clients of goals."""
        if "early" in self._goals and self._node.frames.names:
            early = self._goals.pop("early")
            self._take_goal(early.message, early.client)
        found = self._plans.poll()
        if isinstance(found, tuple):
            self._take_plan(*found)
        elif isinstance(found, USER_ERRORS):
            self._refuse_plan(found)
        elif found is not None:
            raise found
        law = self._laws.poll()
        if isinstance(law, Exception):
            raise law
        if law is not None and self.runner.driving and self._navigator.strategy.has_law:
            self._navigator.complete_forecast()
            self._take_forecast()
        self._look_after_clients()

    def _take_plan(self, wanted: Wanted, strategy: Strategy, what: str, began_s: float) -> None:
        """Drive by a plan; where it is of a goal, the drive to it begins."""
        if self._navigator.use(wanted, strategy):
            self._records.discard_prediction()
            self.runner.set_scenario(strategy.scenario)
        self._reporter.report_plan(strategy, what, began_s)
        if "asked" in self._goals:
            self._begin_drive(self._goals.pop("asked"))

    def _begin_law(self) -> None:
        """Compute the law of arrival of the plan that is driven, once."""
        strategy = self._navigator.strategy
        if strategy is not self._law_of and not self._config.lockstep:
            self._law_of = strategy
            self._laws.begin(lambda: strategy.arrival)

    def _refuse_plan(self, error: Exception) -> None:
        """The plan stays, for the goal that it is for; without one, a goal waits on."""
        if self._navigator.has_plan:
            self._navigator.keep_plan()
            self._end_goal("asked", "abort", str(error), action.NO_VALID_PATH)
        self._refuse_model(error)

    def _refuse_model(self, error: Exception) -> None:
        """Without a plan, wait for another model."""
        if not self._navigator.has_plan:
            self._lack = f"a usable model, and looking again when the file changes: {error}"
            self._navigator.want_model(None, self._config.model)
        self._reporter.report_rejection(error)

    def _begin_drive(self, goal: Goal) -> None:
        """Without resets a goal begins an episode; one that is running leads to it then."""
        self._end_goal("driven", "abort", "a newer goal came")
        self._goals["driven"], self._approach = goal, None
        if self._config.reset or self.runner.driving:
            return
        self._plan.goal_waits = True
        if self.runner.ready:
            self.runner.next_episode()

    def _end_goal(self, stage: Stage, how: action.Ending, reason: str = "", code: int = 0) -> None:
        if stage in self._goals:
            self._goals.pop(stage).end(how, reason, code)

    def _end_goals(self, reason: str) -> None:
        self._approach = None
        for stage in list(self._goals):
            self._end_goal(stage, "abort", reason)

    def _look_after_clients(self) -> None:
        is_due = self._node.wall_s() - self._fed_back_wall_s >= _FEEDBACK_PERIOD_S
        for stage, goal in list(self._goals.items()):
            if goal.client is not None and goal.client.is_cancelled:
                self._cancel(stage)
                self._end_goal(stage, "canceled", "canceled by the client")
            elif goal.client is not None and stage == "driven" and is_due:
                self._fed_back_wall_s = self._node.wall_s()
                self._feed_back(goal.client)

    def _cancel(self, stage: Stage) -> None:
        if stage == "asked":
            self._plans.forget()
            self._navigator.keep_plan()
        elif stage == "driven":  # the robot stands where it is
            self.runner.discard()
            self._records.discard_prediction()
            self._plan.goal_waits, self._approach, self._waypoint = False, None, None
            if self.runner.observation is not None:
                self._publish_waypoint(self.runner.observation)

    def _feed_back(self, client: ActionGoal) -> None:
        seen, forecast = self.runner.observation, self._navigator.forecast
        if seen is None:
            return
        remaining_s = math.nan
        if forecast is not None:
            median_s = typed.quantiles_s(forecast.law, [0.5])[0]
            remaining_s = median_s - (seen.time_s - forecast.time_s)
        way_m = np.vstack([[seen.x_m, seen.y_m], self._navigator.way_m(seen)[1:]])
        client.feed_back(
            motion.to_pose_stamped((seen.x_m, seen.y_m, seen.yaw_rad), seen.time_s),
            self._node.wall_s(),
            remaining_s=remaining_s,
            distance_m=float(np.hypot(*np.diff(way_m, axis=0).T).sum()),
        )


_LOG_PERIOD_S = 5.0


class StrategyReporter:
    """Publishes for a node; all topics but `plan` are latched. time_s: of the last decision."""

    def __init__(self, endpoints: Endpoints) -> None:
        self.time_s = 0.0
        self._node = endpoints.node
        self._shown: Strategy | None = None
        self._goal = endpoints.publisher(PolygonStamped, topics.GOAL_AREA, qos.LATCHED)
        self._arrival, self._decision = (
            endpoints.publisher(TYPES[topic].message, topic, qos.LATCHED)
            for topic in (topics.ARRIVAL, topics.DECISION)
        )
        self._way = endpoints.publisher(PathMessage, topics.PLAN, qos.COMMAND)
        self._arrows = endpoints.publisher(MarkerArray, topics.MARKERS_POLICY, qos.LATCHED)
        self._values = endpoints.publisher(MarkerArray, topics.MARKERS_VALUE, qos.LATCHED)
        self._text = endpoints.publisher(MarkerArray, topics.MARKERS_ARRIVAL, qos.LATCHED)

    def report_plan(self, strategy: Strategy, cause: str, began_s: float) -> None:
        """Publish a new plan and report its remarks; began_s: wall time when planning began."""
        area_m = strategy.scenario.goal_area_m
        self._goal.publish(motion.to_goal_area_message(area_m, self.time_s))
        self.show_policy(strategy)
        took_ms = 1e3 * (self._node.wall_s() - began_s)
        self._node.get_logger().info(f"{cause}: planned and published in {took_ms:.1f} ms")
        remarks = plan_remarks(strategy)
        for remark in remarks:
            self._node.get_logger().warning(remark)
        level = WARN if remarks else OK
        self._node.report(self.time_s, {"remarks": "; ".join(remarks)}, level=level, message=cause)

    def show_policy(self, strategy: Strategy) -> None:
        """Publish markers of a policy once, as soon as there are subscribers: a large map takes as
        long as planning for it."""
        watched = self._arrows.get_subscription_count() or self._values.get_subscription_count()
        if strategy is self._shown or not watched:
            return
        self._shown = strategy
        grid, policy = strategy.problem.grid, strategy.policy
        centers_m, size_m, time_s = grid.centers_m, grid.cell_size_m, self.time_s
        arrows = [Action(int(each)) for each in policy.greedy]
        self._arrows.publish(motion.to_policy_markers(centers_m, arrows, size_m, time_s))
        self._values.publish(motion.to_value_markers(centers_m, policy.value, size_m, time_s))

    def report_way(
        self, navigator: Navigator, observation: Observation, goal: GoalPose | None
    ) -> None:
        """Publish the way from here with predicted times; its last pose is that of the goal."""
        self.time_s = observation.time_s
        state = navigator.strategy.problem.grid.state_at(observation.x_m, observation.y_m)
        if not self._way.get_subscription_count() or state < 0:
            return
        path = timed_path(navigator.strategy, state, self.time_s)
        if goal is not None and navigator.strategy.leads_to_goal(state):
            path.poses[-1].pose = motion.to_goal(goal, path.poses[-1].pose)
        self._way.publish(path)

    def report_goal(self, goal: GoalPose) -> None:
        """Publish the way within the goal cell, which is the pose of the goal alone."""
        path = motion.to_path(np.array([[goal.x_m, goal.y_m]]), self.time_s)
        path.poses[0].pose = motion.to_goal(goal, path.poses[0].pose)
        self._way.publish(path)

    def report_decision(self, navigator: Navigator, observation: Observation) -> None:
        """Publish the decision that was taken there, with its forecast."""
        forecast = navigator.forecast
        if forecast is None:
            return
        strategy = navigator.strategy
        self._decision.publish(typed.to_decision(forecast))
        self._arrival.publish(
            typed.to_arrival_forecast(
                forecast.law, forecast.time_s,
                elapsed_s=forecast.elapsed_s,
                area_m=strategy.scenario.goal_area_m,
                deadline_s=max(strategy.timeout_s - forecast.elapsed_s, 0.0),
            )
        )  # fmt: skip
        if self._text.get_subscription_count():
            place_m = observation.x_m, observation.y_m
            self._text.publish(motion.to_text_marker(forecast.summary, place_m, self.time_s))
        if forecast.needs_attention:
            self._node.get_logger().warning(
                f"{forecast.situation} at ({observation.x_m:.1f}, {observation.y_m:.1f}) m: "
                f"{forecast.summary}",
                throttle_duration_sec=_LOG_PERIOD_S,
            )

    def report_rejection(self, error: Exception) -> None:
        """Report a goal or a model that cannot be used."""
        self._node.get_logger().warning(f"refused: {error}")
        self._node.report(self.time_s, {}, level=WARN, message=f"refused: {error}")

    def report_give_up(self, reason: str) -> None:
        """Report the end of a drive that did not arrive."""
        self._node.report(self.time_s, {"reason": reason}, level=WARN, message="gave up")
