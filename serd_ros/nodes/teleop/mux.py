"""teleop_mux: which of several velocity commands drives the robot, as a ROS 2 node.

After twist_mux; see serd_app.teleop.twist_mux for the rules. It publishes all the time: a stop when
no input drives. `e_stop` (Bool) and `set_e_stop` (SetBool) engage the latch with true and release
it with false; `e_stop_engaged` is its state.
"""

from functools import partial

from geometry_msgs.msg import Twist, TwistStamped
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from serd_app.teleop.mux_settings import load_mux
from serd_app.teleop.twist_mux import MuxOutput, TwistMux, VelocityLimits
from serd_ros.convert.command import from_any_twist, to_twist, to_twist_stamped
from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.followed_topic import follow_commands
from serd_ros.graph.configs import TeleopMuxConfig
from serd_ros.process.serd_node import SerdNode

_REPORT_PERIOD_S = 0.2


class TeleopMuxNode(SerdNode[TeleopMuxConfig]):
    """Converts, calls `TwistMux.step`, publishes `cmd_vel_raw`."""

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        config = self.config
        settings = load_mux(config.mux)
        limits = config.model_dump(exclude={"mux", "rate_hz", "stamped_cmd_vel", "frame_prefix"})
        self._mux = TwistMux(settings, VelocityLimits(**limits))
        self._reported: MuxOutput | None = None
        self._reported_s = self.wall_s()
        for name, source in settings.topics.items():
            twist = TwistStamped if source.stamped else Twist
            follow_commands(self, twist, source.topic, partial(self._take, name))
        for name, lock in settings.locks.items():
            self.create_subscription(Bool, lock.topic, partial(self._lock, name), qos.COMMAND)
        self.create_subscription(Bool, topics.E_STOP, self._take_e_stop, qos.COMMAND)
        self.serve(SetBool, topics.SET_E_STOP, self._on_set_e_stop)
        kind = TwistStamped if config.stamped_cmd_vel else Twist
        self._commands = self.create_publisher(kind, topics.CMD_VEL_RAW, qos.STATE)
        self._engaged = self.create_publisher(Bool, topics.E_STOP_ENGAGED, qos.LATCHED)
        self.create_timer(1.0 / config.rate_hz, self._step)

    def _take(self, name: str, message: Twist | TwistStamped, age_s: float) -> None:
        self._mux.receive(name, from_any_twist(message), self.wall_s() - age_s)

    def _lock(self, name: str, message: Bool) -> None:
        self._mux.receive_lock(name, bool(message.data), self.wall_s())

    def _take_e_stop(self, wanted: Bool | SetBool.Request) -> None:
        self._mux.set_e_stop(bool(wanted.data))
        self._step()

    def _on_set_e_stop(self, request: SetBool.Request) -> str:
        self._take_e_stop(request)
        return "stopped until released" if request.data else "released"

    def _step(self) -> None:
        now_s = self.wall_s()
        output = self._mux.step(now_s)
        if self.config.stamped_cmd_vel:
            time_s = self.get_clock().now().nanoseconds * 1e-9
            self._commands.publish(to_twist_stamped(output.command, time_s))
        else:
            self._commands.publish(to_twist(output.command))
        last = self._reported
        if last is None or last.e_stop != output.e_stop:
            self._engaged.publish(Bool(data=output.e_stop))
        if last is not None and last.e_stop != output.e_stop:
            self.get_logger().warning("E-STOP engaged" if output.e_stop else "e-stop released")
        changed = last is None or (last.active, last.e_stop) != (output.active, output.e_stop)
        if changed or now_s - self._reported_s >= _REPORT_PERIOD_S:
            self._report_output(output, now_s)

    def _report_output(self, output: MuxOutput, now_s: float) -> None:
        """Publish the state on `diagnostics`: at each change, and once in a period."""
        self._reported, self._reported_s = output, now_s
        self.report(
            self.get_clock().now().nanoseconds * 1e-9,
            {
                "active": output.active,
                "e_stop": output.e_stop,
                "locked_by": ", ".join(output.locked_by),
                "held": ", ".join(output.held),
                "rejected_commands": sum(self._mux.n_rejected.values()),
            },
            level=WARN if output.e_stop else OK,
            message="e-stop" if output.e_stop else "",
        )
