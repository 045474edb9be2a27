"""teleop_joy: a joystick's axes and buttons as velocities, as teleop_twist_joy does it."""

from geometry_msgs.msg import Twist
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool

from serd_app.teleop.joy_mapping import JoyDriver, load_joy_mapping
from serd_files.settings import setting
from serd_ros.convert.command import to_twist
from serd_ros.endpoints import qos, topics
from serd_ros.process.serd_node import SerdNode
from serd_ros.settings import NodeConfig


class TeleopJoyConfig(NodeConfig):
    """Parameters of teleop_joy."""

    mapping: str = setting(
        "", "YAML file of axes and buttons as teleop_twist_joy has it; built in when empty"
    )


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
