"""teleop_page: a person drives through a web page, as a ROS 2 node.

The page is served by a thread of its own (serd_app.teleop.page). This node publishes its requests
and sends the state of the world to it, twenty times a second.
"""

from typing import Any

from sensor_msgs.msg import Joy

from serd_app.errors import TeleopError
from serd_app.teleop.page.access import PageAccess, read_token
from serd_app.teleop.page.requests import (
    Away,
    EmergencyStop,
    Episode,
    Hold,
    Joystick,
    Move,
    Override,
    PageRequest,
    SetMode,
)
from serd_app.teleop.page.server import PageServer
from serd_app.teleop.page.view import scene_of
from serd_core.grid.grid import Action
from serd_ros.convert.command import to_joy
from serd_ros.convert.stamp import Jump
from serd_ros.endpoints import qos, topics
from serd_ros.episodes.hand_driver import HandDriverNode
from serd_ros.episodes.page_view import LearnedOverlay, PageView, episode_values
from serd_ros.process.progress import report_address
from serd_sim.world.command import Command

_SILENCE_S = 0.5


class TeleopPageNode(HandDriverNode):
    """One page at a time drives; without its heartbeat the robot stops."""

    def __init__(self, kind: str) -> None:
        self._server: PageServer | None = None
        self._overlay: LearnedOverlay | None = None
        super().__init__(kind)
        config = self.config
        self._heard_s: float | None = None
        self._moving = self._was_released = self._has_gamepad = False
        self._view = PageView(self.scenario)
        self._view.subscribe(self)
        self._joy = self.create_publisher(Joy, topics.JOY, qos.COMMAND)
        access = PageAccess(config.address, read_token(config.token_file))
        scene = scene_of(self.scenario, self._view.grid)
        self._server = PageServer(scene, access, config.port)
        self._overlay = LearnedOverlay(self, self.scenario, self._server)
        report_address(self._server.url, self.get_logger().info)

    def close(self) -> None:
        """End the server."""
        if self._overlay is not None:
            self._overlay.close()
        if self._server is not None:
            self._server.close()

    def clock_jumped(self, jump: Jump) -> None:
        """Show nothing that is stale."""
        self._view.clear()
        super().clock_jumped(jump)

    def notify(self, sentence: str) -> None:
        """Show it on the page and in the log."""
        self.get_logger().info(sentence)
        if self._server is not None:
            self._server.notify(sentence)

    def attend(self) -> bool:
        """Take the page's requests and send it the present state."""
        if self._server is None or self._overlay is None:
            return False
        if self._heard_s is not None and not self._is_there():
            # The mux has stopped the robot. What waits now was held before: it counts anew.
            self._heard_s = None
            self.stop_moving()
        for request in self._server.take():
            self._obey(request)
        there = self._is_there()
        self._overlay.send()
        self._server.show(self._state(self._server, there=there))
        return there

    def _is_there(self) -> bool:
        return self._heard_s is not None and self.wall_s() - self._heard_s <= _SILENCE_S

    def discard_input(self) -> None:
        """Discard the directions; velocities and gamepad count after they were neutral."""
        super().discard_input()
        self._moving = self._was_released = False
        if self._has_gamepad:
            self._joy.publish(Joy())
            self._has_gamepad = False

    def _obey(self, request: PageRequest) -> None:
        if isinstance(request, Away):
            self._heard_s = None
            self.stop_moving()
            return
        if isinstance(request, Hold | Move | Joystick):
            self._heard_s = self.wall_s()
        try:
            self._act(request)
        except TeleopError as error:
            self.notify(str(error))

    def _act(self, request: PageRequest) -> None:
        if isinstance(request, Hold):
            self.choice.hold(
                None if request.direction is None else Action[request.direction.upper()]
            )
        elif isinstance(request, Move):
            self._move(request)
        elif isinstance(request, Joystick):
            time_s = self.observation.time_s if self.observation is not None else 0.0
            self._joy.publish(to_joy(request.axes, request.buttons, time_s))
            self._has_gamepad = True
        elif isinstance(request, Override):
            self.override_guard()
        elif isinstance(request, SetMode):
            self.set_mode(request.mode)
        elif isinstance(request, EmergencyStop):
            self.set_e_stop(request.engaged)
        elif isinstance(request, Episode):
            steps = {
                "start": self.episodes.start,
                "save": self.episodes.save,
                "discard": self.episodes.discard,
            }
            steps[request.do]()

    def _move(self, request: Move) -> None:
        """Drive while a direction is held; one stop when it is released, then nothing."""
        moving = request.linear != 0.0 or request.angular != 0.0
        self._was_released |= not moving
        if not self._was_released:
            return
        if self.mode == "velocity" and (moving or self._moving):
            linear_mps = request.linear * self.config.speed_mps
            self.drive(Command(linear_mps, request.angular * self.config.turn_radps))
        self._moving = moving

    def _state(self, server: PageServer, *, there: bool) -> dict[str, Any]:
        return {
            **self._view.state(self.observation, episode_values(self.episodes), self.wall_s()),
            "page": server.driving_page,
            "there": there,
            "mode": self.mode,
            "choice": self.choice.upcoming.name.lower(),
        }
