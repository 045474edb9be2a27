"""guard: passes commands on to the robot as far as its inputs and obstacles allow, as a ROS 2 node.

See serd_sim.safety for the rules. In lock-step each command is answered by one command with its
stamp, once the inputs of that stamp have arrived. Live, a command is answered at once, and a timer
stops the robot when inputs or commands stop coming, or when several nodes publish commands; without
a command the node publishes nothing.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Literal

from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from std_msgs.msg import Bool

from serd_files.settings import setting, setting_of
from serd_ros.convert import typed
from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.convert.motion import PlanarPose, from_any_twist, from_odometry, from_twist_stamped
from serd_ros.convert.stamp import stamp_s
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.followed_topic import PeopleTopic
from serd_ros.endpoints.robot import LOCALISATIONS, CommandPublisher, follow_commands, follow_scans
from serd_ros.endpoints.topic_types import TYPES
from serd_ros.errors import NodeError
from serd_ros.graph.graph import Readiness, publishers_of
from serd_ros.process.serd_node import SerdNode
from serd_ros.settings import LidarConfig, LocalisationConfig, ObservationConfig, StackConfig
from serd_sim.safety.guard import Guard, GuardOutput
from serd_sim.safety.reasons import Fault, GuardAction, Reason, Source
from serd_sim.safety.scan import Scan, ZeroRanges
from serd_sim.safety.settings import GuardSettings
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import STOP, Command
from serd_sim.world.observation import People

_REPORT_PERIOD_S = 0.5
_LOG_PERIOD_S = 5.0
#: A longer time (s) between two steps means that this process was stopped.
_PAUSE_S = 0.5
#: Zeros are counted in one of so many scans.
_SCANS_PER_LOOK = 10
_CLOCK_STANDS = GuardOutput(STOP, GuardAction.STOP, (Reason(Source.CLOCK, Fault.STALE),))


class GuardConfig(GuardSettings, StackConfig, LidarConfig):
    """Parameters of guard; those of `GuardSettings` default to the scenario's robot."""

    scenario: str = setting(
        "", "the guarded robot, and walls that a lidar must see; any other robot when empty"
    )
    pose_from: Literal["robot_pose", "tf"] = setting_of(LocalisationConfig, "pose_from")
    people_topic: str = setting_of(ObservationConfig, "people_topic")
    lockstep: bool = setting_of(StackConfig, "lockstep", description="answer each stamp once")
    stamped_cmd_vel: bool = setting(False, "cmd_vel_raw and cmd_vel are TwistStamped")
    stop_pub_timeout: float = setting(1.0, "publish no stop longer", unit="s", live="any", ge=0)
    clock_timeout: float = setting(
        1.0, "live: stop when the clock stands", unit="s", live="lower", gt=0
    )

    @classmethod
    def defaults(cls, given: Mapping[str, Any]) -> dict[str, Any]:
        """The defaults, with the robot of the scenario that is given."""
        defaults = super().defaults(given)
        name = given.get("scenario", "")
        if not isinstance(name, str) or not name:
            return defaults
        people_from = given.get("people_from", defaults["people_from"])
        guard = GuardSettings.of_scenario(load_scenario(name), str(people_from)).model_dump()
        if "acc_lim_x" in given:
            guard["decel_lim_x"] = 0.0  # a robot that accelerates less may brake less
        return defaults | guard

    def guard(self) -> GuardSettings:
        """The settings of the guard itself."""
        return GuardSettings(**self.model_dump(include=set(GuardSettings.model_fields)))


class GuardNode(SerdNode[GuardConfig]):
    """Converts, calls `Guard.step`, publishes `cmd_vel`."""

    config_class = GuardConfig

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        config = self.config
        self._refuse_own_output()
        # Its ticks have scans or not.
        self._scenario = load_scenario(config.scenario or "hallway")
        walls_m = self._scenario.wall_segments_m if config.scenario else None
        self._guard, self._zeros = Guard(config.guard(), walls_m), ZeroRanges()
        self._several: tuple[Reason, ...] = ()
        self._n_scans = 0
        self._waiting: dict[Source, tuple[int, Callable[[], None]]] = {}
        self._answer: tuple[int, Command] | None = None
        self._readiness = Readiness(self, config.required_nodes, self.wall_s())
        self._clock_s, self._clock_wall_s = -1.0, self.wall_s()
        self._stepped_wall_s = self._reported_wall_s = 0.0
        self._reported: object = None
        endpoints, stamped = self.endpoints, config.stamped_cmd_vel or config.lockstep
        self._commands = CommandPublisher(endpoints, topics.CMD_VEL, stamped=stamped)
        kind = TYPES[topics.GUARD_STATE].message
        self._states = endpoints.publisher(kind, topics.GUARD_STATE, qos.LATCHED)
        inputs = self._inputs = endpoints.scope()
        self._localisation = LOCALISATIONS[config.pose_from](inputs, self._take_pose)
        inputs.subscribe(Odometry, topics.ODOM, self._on_odometry, qos.STATE)
        PeopleTopic(inputs, config.people_topic, self._on_people)
        profile = qos.STATE if config.lockstep else qos.SENSOR
        follow_scans(inputs, config, self._on_scan, profile)
        if config.lockstep:
            endpoints.subscribe(TwistStamped, topics.CMD_VEL_RAW, self._on_stamped, qos.COMMAND)
        else:
            follow_commands(endpoints, topics.CMD_VEL_RAW, self._on_command, stamped=stamped)
            endpoints.subscribe(Bool, topics.GUARD_OVERRIDE, self._on_override, qos.COMMAND)
            period_s = 1.0 / config.controller_frequency
            endpoints.every(period_s, self._watch)

    def check_change(self, config: GuardConfig) -> None:
        """Stricter limits count at once, others while the robot stands."""
        self._guard.require_may_change(config.guard(), self.now_s())

    def take_change(self, config: GuardConfig) -> None:
        """Guard by the parameters that were set."""
        self._guard.change(config.guard())

    def _refuse_own_output(self) -> None:
        """NodeError where the node would take what it publishes as commands."""
        raw, out = map(self.resolve_topic_name, (topics.CMD_VEL_RAW, topics.CMD_VEL))
        if raw == out:
            raise NodeError(
                f"cmd_vel_raw and cmd_vel must be two topics, got {out} for both; remap one of them"
                " only, for instance -r cmd_vel_raw:=nav_vel"
            )

    def _look_for_publishers(self) -> None:
        """Stand while another node commands the robot, or several nodes the guard."""
        several = []
        for source in (Source.COMMAND, Source.OUTPUT):
            topic = self.resolve_topic_name(source.value)
            if self.count_publishers(topic) > 1:
                several.append(Reason(source, Fault.SEVERAL))
                self.get_logger().warning(
                    f"{topic} has several publishers: {', '.join(publishers_of(self, topic))}; end"
                    " all but one, or let teleop_mux choose between them",
                    throttle_duration_sec=_LOG_PERIOD_S,
                )
        self._several = tuple(several)

    def _on_odometry(self, message: Odometry) -> None:
        time_ns, pose, speeds = from_odometry(message, self.frames)
        self._take(Source.ODOMETRY, time_ns, self._guard.receive_odometry, pose, speeds)

    def _take_pose(self, time_ns: int, pose: PlanarPose) -> None:
        self._take(Source.POSE, time_ns, self._guard.receive_pose, pose)

    def _on_people(self, time_ns: int, people: People) -> None:
        receive = self._guard.receive_people
        self._take(Source.PEOPLE, time_ns, receive, people.position_m, people.velocity_mps)

    def _on_scan(self, time_ns: int, scan: Scan) -> None:
        self._n_scans += 1
        if self._n_scans % _SCANS_PER_LOOK == 0:
            self._zeros.take(scan)
        self._take(Source.SCAN, time_ns, lambda _: self._guard.receive_scan(scan))

    def _on_stamped(self, message: TwistStamped) -> None:
        time_ns, command = from_twist_stamped(message)
        self._take(Source.COMMAND, time_ns, self._guard.receive_command, command)

    def _notice_pause(self) -> None:
        """End the command of before a pause of this process, whose /clock may be behind."""
        if self._stepped_wall_s and self.wall_s() - self._stepped_wall_s > _PAUSE_S:
            self._guard.receive_command(self.now_s() - 2.0 * self.config.command_timeout, STOP)

    def _on_command(self, message: Twist | TwistStamped, age_s: float) -> None:
        self._notice_pause()
        now_s = self.now_s()
        command, time_s = from_any_twist(message), now_s
        if isinstance(message, TwistStamped):
            time_s = stamp_s(message.header.stamp)
        self._guard.advance(now_s)
        self._guard.receive_command(min(time_s, now_s - age_s), command)
        self._step()

    def _on_override(self, message: Bool) -> None:
        self._guard.receive_override(self.now_s(), bool(message.data))

    def _take(
        self, source: Source, time_ns: int, receive: Callable[..., None], *values: Any
    ) -> None:
        """Live, pass an input on; in lock-step, keep it until all of its stamp are here."""
        take = partial(receive, time_ns * 1e-9, *values)
        if not self.config.lockstep:
            self._guard.advance(self.now_s())
            take()
            return
        self._waiting[source] = time_ns, take
        self._answer_tick()

    def _answer_tick(self) -> None:
        """Answer the present stamp once; a repeated command gets the same answer."""
        if Source.COMMAND not in self._waiting or not self._readiness.was_ready(self.wall_s()):
            return  # until all required nodes subscribe the world repeats its tick
        time_ns = self._waiting[Source.COMMAND][0]
        if self._answer is None or self._answer[0] != time_ns:
            if not all(self._is_here(source, time_ns) for source in self._guard.sources):
                return
            self._guard.advance(time_ns * 1e-9)
            for stamp_ns, receive in self._waiting.values():
                if stamp_ns == time_ns:
                    receive()
            output = self._guard.step(time_ns * 1e-9)
            self._answer = time_ns, output.command
            self._report_change(output, time_ns * 1e-9)
        del self._waiting[Source.COMMAND]
        self._commands.publish(self._answer[1], time_ns * 1e-9)

    def _is_here(self, source: Source, time_ns: int) -> bool:
        """Whether the input of a stamp has arrived, or there is none."""
        tick = round(time_ns * 1e-9 / self._scenario.control_period_s)
        if source is Source.SCAN and tick % self._scenario.ticks_per_scan:
            return True
        return source in self._waiting and self._waiting[source][0] == time_ns

    def _watch(self) -> None:
        """Step when no command has come for a period."""
        self._notice_pause()
        self._look_for_publishers()
        if self.wall_s() - self._stepped_wall_s >= 1.0 / self.config.controller_frequency:
            self._step()

    def _step(self) -> None:
        """Judge by what has arrived, not by what this process has had the time to take."""
        self._inputs.take_waiting()
        now_s, self._stepped_wall_s = self.now_s(), self.wall_s()
        if now_s != self._clock_s:
            self._clock_s, self._clock_wall_s = now_s, self._stepped_wall_s
        output = self._guard.step(now_s)
        if self._several:
            output = GuardOutput(STOP, GuardAction.STOP, self._several)
        if self._stepped_wall_s - self._clock_wall_s > self.config.clock_timeout:
            output = _CLOCK_STANDS
        silent_s = self._guard.command_age_s(now_s) - self.config.command_timeout
        if silent_s <= self.config.stop_pub_timeout:
            self._commands.publish(output.command, now_s)
        self._report_change(output, now_s)

    def _report_change(self, output: GuardOutput, now_s: float) -> None:
        """Report at once when action, reasons or override change, else now and then."""
        state, wall_s = (output.action, output.reasons, output.overridden), self.wall_s()
        if state == self._reported and wall_s - self._reported_wall_s < _REPORT_PERIOD_S:
            return
        self._reported, self._reported_wall_s = state, wall_s
        ages = self._guard.ages_s(now_s)
        self._states.publish(typed.to_guard_state(output, now_s))
        values: dict[str, Any] = {
            **{f"age_s.{source.value}": age_s for source, age_s in ages.items()},
            "rejected": sum(self._guard.n_rejected.values()),
            "zero_ranges": self._zeros.sentence(self.config.zero_is),
            "localisation": self._localisation.fault(),
        }
        state_name = "overridden" if output.overridden else output.action.name
        level = WARN if output.overridden or output.action is GuardAction.STOP else OK
        self.report(now_s, values, level=level, message=state_name)
