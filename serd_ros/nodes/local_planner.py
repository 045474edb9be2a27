"""local_planner: follows the current waypoint or intent, as a ROS 2 node.

In lock-step every observation is answered by one command with its stamp; where a decision epoch
begins the answer waits for the waypoint or intent of that tick. Live, every observation is answered
at once, and the robot stops when they, or waypoints and intents, stop coming. An engaged e-stop
discards waypoints and intents.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped, Vector3Stamped
from std_msgs.msg import Bool

from serd_core.grid.grid import Action
from serd_files.settings import setting, setting_of
from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.convert.motion import from_intent, from_waypoint_message
from serd_ros.convert.stamp import Jump, stamp_ns, to_stamp
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.robot import CommandPublisher, ObservationSource
from serd_ros.graph.graph import Readiness
from serd_ros.process.serd_node import Activate, Activity, Endpoints, SerdNode
from serd_ros.settings import ManagedConfig, ObservationConfig, StackConfig
from serd_sim.episodes.episode import EpisodeSettings
from serd_sim.planning.local_planner import PlannerStatus, RecoveringPlanner, make_planner
from serd_sim.planning.settings import PlannerSettings
from serd_sim.scenario.scenario import Scenario, load_scenario
from serd_sim.world.command import STOP, Command
from serd_sim.world.epochs import epochs_in
from serd_sim.world.observation import Observation, is_next_episode
from serd_sim.world.waypoint import FollowedDirective, Waypoint, resolved


class LocalPlannerConfig(PlannerSettings, StackConfig, ObservationConfig, ManagedConfig):
    """Parameters of local_planner; those of `PlannerSettings` default to the scenario's."""

    scenario: str = setting_of(EpisodeSettings, "scenario")
    lockstep: bool = setting_of(StackConfig, "lockstep", description="answer each stamp once")
    input_timeout_s: float = setting(
        0.5, "stop without observations", unit="s", live="any", gt=0, le=0.5
    )

    @classmethod
    def defaults(cls, given: Mapping[str, Any]) -> dict[str, Any]:
        """The defaults, with the planner and the robot of the scenario that is given."""
        defaults = super().defaults(given)
        name = given.get("scenario", defaults["scenario"])
        if not isinstance(name, str) or not name:
            return defaults  # validation rejects the name
        scenario = load_scenario(name)
        planner = scenario.local_planner.complete(scenario.robot, scenario.control_period_s)
        return defaults | planner.model_dump()

    def planned_scenario(self) -> Scenario:
        """The scenario with the planner's parameters of this node."""
        own = self.model_dump(include=set(PlannerSettings.model_fields))
        return load_scenario(self.scenario).with_local_planner(PlannerSettings(**own))


class LocalPlannerNode(SerdNode[LocalPlannerConfig]):
    """Plans while it is active."""

    config_class = LocalPlannerConfig

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        self.planner: RecoveringPlanner | None = None

    def configure(self) -> Activate:
        """Load the scenario and make the planner."""
        scenario = self.config.planned_scenario()
        self.planner = make_planner(scenario)
        return partial(Planning, scenario)

    def check_change(self, config: LocalPlannerConfig) -> None:
        """Refuse what no planner can be made with."""
        config.planned_scenario()

    def take_change(self, config: LocalPlannerConfig) -> None:
        """Plan by the parameters that were set."""
        if self.planner is not None:
            self.planner = make_planner(config.planned_scenario())


class Planning(Activity):
    """Converts, calls the planner's `step`, publishes `cmd_vel_raw`."""

    def __init__(self, scenario: Scenario, endpoints: Endpoints) -> None:
        node = self._node = endpoints.node
        config = self._config = node.config
        self._scenario, self._cells = scenario, scenario.cells
        self._planner.reset()
        self._status = self._planner.status
        self._observation: Observation | None = None
        self._directive: tuple[int, Action | Waypoint] | None = None
        #: Of the newest waypoint: at the robot's own place, live, where the robot is to turn to.
        self._heading_rad: float | None = None
        self._followed, self._epochs = FollowedDirective(scenario), epochs_in(scenario)
        self._is_overdue = self._is_e_stopped = False
        self._waypoint: Waypoint | None = None
        self._answer: tuple[int, Command] | None = None
        self._heard_wall_s = node.wall_s()
        self._readiness = Readiness(node, config.required_nodes, node.wall_s())
        stamped = config.stamped_cmd_vel or config.lockstep
        self._commands = CommandPublisher(endpoints, topics.CMD_VEL_RAW, stamped=stamped)
        ObservationSource(
            endpoints, scenario.control_period_s, self._on_observation, config,
            on_jump=self._on_jump, needs_people=config.people_from == "given",
        )  # fmt: skip
        endpoints.subscribe(Vector3Stamped, topics.INTENT, self._on_intent, qos.COMMAND)
        endpoints.subscribe(PoseStamped, topics.WAYPOINT, self._on_waypoint, qos.COMMAND)
        if not config.lockstep:
            endpoints.subscribe(Bool, topics.E_STOP_ENGAGED, self._on_e_stop, qos.LATCHED)
            endpoints.every(scenario.control_period_s, self._stop_when_stale)

    @property
    def _planner(self) -> RecoveringPlanner:
        """The node's, which another one replaces where parameters change."""
        return self._node.planner

    def deactivate(self) -> None:
        """Leave the robot standing."""
        if self._followed.is_given and self._observation is not None:
            self._commands.publish(STOP, self._observation.time_s)

    def _on_jump(self, jump: Jump) -> None:
        """Stand until the next waypoint or intent."""
        self._begin_anew()
        if jump is Jump.BACKWARD:
            self._answer = None

    def _begin_anew(self) -> None:
        self._planner.reset()
        self._followed.stand()
        self._epochs.begin()
        self._waypoint = None

    def _on_intent(self, message: Vector3Stamped) -> None:
        self._heading_rad = None
        self._take_directive(*from_intent(message, self._node.frames))

    def _on_waypoint(self, message: PoseStamped) -> None:
        time_ns, waypoint, heading_rad = from_waypoint_message(message, self._node.frames)
        self._heading_rad = None if self._config.lockstep else heading_rad
        self._take_directive(time_ns, waypoint)

    def _take_directive(self, time_ns: int, directive: Action | Waypoint) -> None:
        self._directive = time_ns, directive
        if self._config.lockstep:
            self._answer_tick()
        elif not self._is_e_stopped:
            newest_s = 0.0 if self._observation is None else self._observation.time_s
            # A message by hand has no stamp.
            self._followed.take(time_ns * 1e-9 if time_ns else newest_s, directive)

    def _on_e_stop(self, message: Bool) -> None:
        """Discard what was asked for before the e-stop was engaged, and while it is."""
        was_stopped, self._is_e_stopped = self._is_e_stopped, bool(message.data)
        if was_stopped or self._is_e_stopped:
            self._followed.clear()
            self._planner.reset()

    def _on_observation(self, observation: Observation) -> None:
        last, self._observation = self._observation, observation
        self._heard_wall_s = self._node.wall_s()
        period_s = self._scenario.control_period_s
        if last is None or is_next_episode(last, observation, period_s):
            self._begin_anew()
        if self._config.lockstep:
            self._answer_tick()
        else:
            self._answer_live(observation)

    def _answer_tick(self) -> None:
        """Answer the present tick once all it depends on is here; a repeated one the same way."""
        observation = self._observation
        if observation is None or not self._readiness.was_ready(self._node.wall_s()):
            return  # until all required nodes subscribe the world repeats its tick
        time_ns = stamp_ns(to_stamp(observation.time_s))
        if self._answer is None or self._answer[0] != time_ns:
            if self._epochs.begins(observation):
                if self._directive is None or self._directive[0] != time_ns:
                    return
                action, self._waypoint = resolved(self._cells, observation, self._directive[1])
                self._epochs.take(observation.time_s, action)
            self._answer = time_ns, self._plan(observation)
        self._commands.publish(self._answer[1], observation.time_s)

    def _answer_live(self, observation: Observation) -> None:
        if not self._followed.is_given:
            return  # without a directive, cmd_vel is left to other publishers
        self._waypoint = self._followed.waypoint(observation)
        self._report_overdue(observation)
        self._commands.publish(self._plan(observation), observation.time_s)

    def _stop_when_stale(self) -> None:
        silent_s, observation = self._node.wall_s() - self._heard_wall_s, self._observation
        if observation is None or not self._followed.is_given:
            return
        if silent_s <= self._node.config.input_timeout_s:
            return
        text = f"no pose or people received for {silent_s:.1f} s: stopping"
        self._node.get_logger().warning(text, throttle_duration_sec=2.0)
        self._node.report(observation.time_s, {"silent_s": silent_s}, level=WARN, message="stale")
        self._commands.publish(STOP, observation.time_s)

    def _report_overdue(self, observation: Observation) -> None:
        """Publish that the source of waypoints is silent, or no longer so, when that changes."""
        if self._followed.is_overdue == self._is_overdue:
            return
        self._is_overdue = self._followed.is_overdue
        values = {"directive_age_s": self._followed.age_s(observation)}
        level, message = (WARN, "no recent waypoint") if self._is_overdue else (OK, "")
        self._node.report(observation.time_s, values, level=level, message=message)

    def _plan(self, observation: Observation) -> Command:
        """The planner's command; its status is published when it changes."""
        command = self._planner.step(observation, self._waypoint)
        if self._waypoint is None and self._heading_rad is not None and self._followed.is_recent:
            command = self._planner.turn(observation, self._heading_rad)
        if self._planner.status != self._status:
            self._status = self._planner.status
            level = OK if self._status is PlannerStatus.NONE else WARN
            values = {"status": int(self._status), "recoveries": self._planner.n_recoveries}
            self._node.report(observation.time_s, values, level=level, message=self._status.name)
        return command
