"""local_planner: follows the current waypoint or intent, as a ROS 2 node.

In lock-step every observation is answered by one command with its stamp; where a decision epoch
begins the answer waits for the waypoint or intent of that tick. Live, every observation is answered
at once, and the robot stops when they, or waypoints and intents, stop coming. An engaged e-stop
discards waypoints and intents.
"""

from geometry_msgs.msg import PoseStamped, Twist, TwistStamped, Vector3Stamped
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool

from serd_core.grid.grid import Action
from serd_ros.convert.command import from_intent, to_twist, to_twist_stamped
from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.convert.pose import from_waypoint_message
from serd_ros.convert.sensors import from_scan
from serd_ros.convert.stamp import Jump, stamp_ns, to_stamp
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.observation import ObservationSource
from serd_ros.graph.configs import LocalPlannerConfig
from serd_ros.graph.readiness import Readiness
from serd_ros.process.managed_node import ManagedNode
from serd_sim.perception.scanning_planner import ScanMatcher
from serd_sim.planning.catalogue import make_planner
from serd_sim.planning.local_planner import PlannerStatus
from serd_sim.scenario.grid import grid_of
from serd_sim.world.command import STOP, Command
from serd_sim.world.directive import FollowedDirective, resolved
from serd_sim.world.epochs import epochs_in
from serd_sim.world.observation import Observation, is_next_episode
from serd_sim.world.waypoint import Waypoint


class LocalPlannerNode(ManagedNode[LocalPlannerConfig]):
    """Converts, calls `LocalPlanner.step`, publishes `cmd_vel_raw`."""

    def configure(self) -> None:
        """Load the scenario and make the planner."""
        self._scenario = self.config.planned_scenario()
        self._grid = grid_of(self._scenario)
        self._scans = ScanMatcher(self._scenario) if self.config.people_from == "scan" else None
        planner = make_planner(self.config.planner, self._scenario)
        self._planner = self._scans.planner_on(planner) if self._scans else planner

    def activate(self) -> None:
        """Follow waypoints and intents, from now on only."""
        self._planner.reset()
        self._status = self._planner.status
        self._observation: Observation | None = None
        self._directive: tuple[int, Action | Waypoint] | None = None
        self._followed = FollowedDirective(self._scenario)
        self._epochs = epochs_in(self._scenario, self._grid)
        self._is_overdue = self._is_e_stopped = False
        self._waypoint: Waypoint | None = None
        self._answer: tuple[int, Command] | None = None
        self._heard_wall_s = self.wall_s()
        self._readiness = Readiness(self, self.config.required_nodes, self.wall_s())
        self._stamped = self.config.stamped_cmd_vel or self.config.lockstep
        kind = TwistStamped if self._stamped else Twist
        self._commands = self.create_publisher(kind, topics.CMD_VEL_RAW, qos.STATE)
        if self._scans:
            self._scans.reset()
            profile = qos.STATE if self.config.lockstep else qos.SENSOR
            self.create_subscription(LaserScan, topics.SCAN, self._on_scan, profile)
        ObservationSource(
            self,
            self._scenario.control_period_s,
            self._on_observation,
            self.config,
            needs_people=self.config.people_from == "given",
        )
        self.create_subscription(Vector3Stamped, topics.INTENT, self._on_intent, qos.COMMAND)
        self.create_subscription(PoseStamped, topics.WAYPOINT, self._on_waypoint, qos.COMMAND)
        if not self.config.lockstep:
            self.create_subscription(Bool, topics.E_STOP_ENGAGED, self._on_e_stop, qos.LATCHED)
            period_s = self._scenario.control_period_s
            self.create_timer(period_s, self._stop_when_stale)

    def deactivate(self) -> None:
        """Leave the robot standing."""
        if self._followed.is_given and self._observation is not None:
            self._send(STOP, self._observation.time_s)
        super().deactivate()

    def clock_jumped(self, jump: Jump) -> None:
        """Stand until the next waypoint or intent; a new session discards the scans, too."""
        self._begin_anew()
        if jump is Jump.BACKWARD:
            self._answer = None
            if self._scans:
                self._scans.reset()

    def _begin_anew(self) -> None:
        self._planner.reset()
        self._followed.stand()
        self._epochs.begin()
        self._waypoint = None

    def _on_scan(self, message: LaserScan) -> None:
        assert self._scans is not None
        self._scans.take_scan(*from_scan(message, self._scenario.lidar))
        if self.config.lockstep:
            self._answer_tick()

    def _on_intent(self, message: Vector3Stamped) -> None:
        self._take_directive(*from_intent(message, self.frames))

    def _on_waypoint(self, message: PoseStamped) -> None:
        self._take_directive(*from_waypoint_message(message, self.frames))

    def _take_directive(self, time_ns: int, directive: Action | Waypoint) -> None:
        self._directive = time_ns, directive
        if self.config.lockstep:
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
        self._heard_wall_s = self.wall_s()
        period_s = self._scenario.control_period_s
        if last is None or is_next_episode(last, observation, period_s):
            self._begin_anew()
        if self._scans:
            self._scans.take_observation(observation)
        if self.config.lockstep:
            self._answer_tick()
        else:
            self._answer_live(observation)

    def _answer_tick(self) -> None:
        """Answer the present tick once all it depends on is here; a repeated one the same way."""
        observation = self._observation
        if observation is None or not self._readiness.was_ready(self.wall_s()):
            return  # until all required nodes subscribe the world repeats its tick
        time_ns = stamp_ns(to_stamp(observation.time_s))
        if self._scans and not self._scans.is_complete(observation):
            return
        if self._answer is None or self._answer[0] != time_ns:
            if self._epochs.begins(observation):
                if self._directive is None or self._directive[0] != time_ns:
                    return
                action, self._waypoint = resolved(self._grid, observation, self._directive[1])
                self._epochs.take(observation.time_s, action)
            self._answer = time_ns, self._plan(observation)
        self._send(self._answer[1], observation.time_s)

    def _answer_live(self, observation: Observation) -> None:
        if not self._followed.is_given:
            return  # without a directive, cmd_vel is left to other publishers
        self._waypoint = self._followed.waypoint(observation)
        self._report_overdue(observation)
        self._send(self._plan(observation), observation.time_s)

    def _stop_when_stale(self) -> None:
        silent_s = self.wall_s() - self._heard_wall_s
        observation = self._observation
        if observation is None or not self._followed.is_given:
            return
        if silent_s <= self.config.input_timeout_s:
            return
        self.get_logger().warning(
            f"no pose or people received for {silent_s:.1f} s: stopping", throttle_duration_sec=2.0
        )
        self.report(observation.time_s, {"silent_s": silent_s}, level=WARN, message="stale")
        self._send(STOP, observation.time_s)

    def _report_overdue(self, observation: Observation) -> None:
        """Publish that the source of waypoints is silent, or no longer so, when that changes."""
        if self._followed.is_overdue == self._is_overdue:
            return
        self._is_overdue = self._followed.is_overdue
        age_s = self._followed.age_s(observation)
        level, message = (WARN, "no recent waypoint") if self._is_overdue else (OK, "")
        self.report(observation.time_s, {"directive_age_s": age_s}, level=level, message=message)

    def _plan(self, observation: Observation) -> Command:
        """The planner's command; its status is published when it changes."""
        command = self._planner.step(observation, self._waypoint)
        if self._planner.status != self._status:
            self._status = self._planner.status
            level = OK if self._status is PlannerStatus.NONE else WARN
            values = {"status": int(self._status), "recoveries": self._planner.n_recoveries}
            self.report(observation.time_s, values, level=level, message=self._status.name)
        return command

    def _send(self, command: Command, time_s: float) -> None:
        message = to_twist_stamped(command, time_s) if self._stamped else to_twist(command)
        self._commands.publish(message)
