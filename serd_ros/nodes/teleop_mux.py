"""teleop_mux: which of several velocity commands drives; teleop_joy: a joystick as one of them.

After twist_mux; see serd_app.teleop.twist_mux for the rules. It publishes all the time: a stop when
no input drives. `e_stop` (Bool) and `set_e_stop` (SetBool) engage the latch with true and release
it with false; `e_stop_engaged` is its state.
"""

from functools import partial

from geometry_msgs.msg import Twist, TwistStamped
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from serd_app.teleop.joy_mapping import JoyDriver, load_joy_mapping
from serd_app.teleop.twist_mux import MuxOutput, TwistMux, VelocityLimits, load_mux
from serd_files.settings import setting, setting_of
from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.convert.motion import from_any_twist, to_twist
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.robot import CommandPublisher, follow_commands
from serd_ros.process.serd_node import SerdNode
from serd_ros.settings import FramesConfig, NodeConfig, StackConfig
from serd_sim.scenario.settings import RobotSettings

_REPORT_PERIOD_S = 0.2
_ROBOT = RobotSettings()


class TeleopMuxConfig(FramesConfig):
    """Parameters of teleop_mux."""

    mux: str = setting("", "YAML file of inputs and locks as twist_mux has it; built in when empty")
    rate_hz: float = setting(50.0, "rate of cmd_vel", unit="Hz", ge=10, le=200)
    stamped_cmd_vel: bool = setting_of(StackConfig, "stamped_cmd_vel")
    max_vel_x_mps: float = setting(_ROBOT.max_vel_x_mps, "largest speed", unit="m/s", gt=0)
    min_vel_x_mps: float = setting(_ROBOT.min_vel_x_mps, "backwards", unit="m/s", le=0)
    max_vel_theta_radps: float = setting(
        _ROBOT.max_vel_theta_radps, "largest turning rate", unit="rad/s", gt=0
    )
    acc_lim_x_mps2: float = setting(
        _ROBOT.acc_lim_x_mps2, "largest acceleration and braking", unit="m/s2", gt=0
    )
    acc_lim_theta_radps2: float = setting(
        _ROBOT.acc_lim_theta_radps2, "largest angular acceleration", unit="rad/s2", gt=0
    )


class TeleopMuxNode(SerdNode[TeleopMuxConfig]):
    """Converts, calls `TwistMux.step`, publishes `cmd_vel_raw`."""

    config_class = TeleopMuxConfig

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        config = self.config
        settings = load_mux(config.mux)
        limits = config.model_dump(exclude={"mux", "rate_hz", "stamped_cmd_vel", "frame_prefix"})
        self._mux = TwistMux(settings, VelocityLimits(**limits))
        self._reported: MuxOutput | None = None
        self._reported_s = self.wall_s()
        for name, source in settings.topics.items():
            take = partial(self._take, name)
            follow_commands(self.endpoints, source.topic, take, stamped=source.stamped)
        for name, lock in settings.locks.items():
            self.endpoints.subscribe(Bool, lock.topic, partial(self._lock, name), qos.COMMAND)
        self.endpoints.subscribe(Bool, topics.E_STOP, self._take_e_stop, qos.COMMAND)
        self.endpoints.serve(SetBool, topics.SET_E_STOP, self._on_set_e_stop)
        self._commands = CommandPublisher(
            self.endpoints, topics.CMD_VEL_RAW, stamped=config.stamped_cmd_vel
        )
        self._engaged = self.endpoints.publisher(Bool, topics.E_STOP_ENGAGED, qos.LATCHED)
        self.endpoints.every(1.0 / config.rate_hz, self._step)

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
        self._commands.publish(output.command, self.now_s())
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
        values = {
            "active": output.active,
            "e_stop": output.e_stop,
            "locked_by": ", ".join(output.locked_by),
            "held": ", ".join(output.held),
            "rejected_commands": sum(self._mux.n_rejected.values()),
        }
        level, message = (WARN, "e-stop") if output.e_stop else (OK, "")
        self.report(self.now_s(), values, level=level, message=message)


class TeleopJoyConfig(NodeConfig):
    """Parameters of teleop_joy."""

    mapping: str = setting("", "YAML file as of teleop_twist_joy; built in when empty")


class TeleopJoyNode(SerdNode[TeleopJoyConfig]):
    """`joy` in, `cmd_vel_joy` out; publishes nothing while the enable button is not held."""

    config_class = TeleopJoyConfig

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        self._driver = JoyDriver(load_joy_mapping(self.config.mapping))
        self._commands = self.endpoints.publisher(Twist, topics.CMD_VEL_JOY, qos.COMMAND)
        self._override = self.endpoints.publisher(Bool, topics.GUARD_OVERRIDE, qos.COMMAND)
        self.endpoints.subscribe(Joy, topics.JOY, self._on_joy, qos.COMMAND)
        self.endpoints.subscribe(Bool, topics.E_STOP_ENGAGED, self._on_e_stop, qos.LATCHED)

    def _on_e_stop(self, _: Bool) -> None:
        """Engaged or released: the axes must return to neutral."""
        self._driver.require_neutral()

    def _on_joy(self, message: Joy) -> None:
        command = self._driver.command(list(message.axes), list(message.buttons))
        if command is not None:
            self._commands.publish(to_twist(command))
        if self._driver.overrides(message.buttons):
            self._override.publish(Bool(data=True))
