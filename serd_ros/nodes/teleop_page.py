"""teleop_page: a person drives through a web page by directions or by velocities, as a ROS 2 node.

The page is served by a thread of its own (serd_app.teleop.page). This node publishes its requests
and sends the state of the world to it, twenty times a second.

By directions, an `intent` is published when another direction is held or none any more, and again
where a decision epoch begins: in an episode of this driver from the first direction on, waits
included, otherwise only while a direction is held. By velocities, `cmd_vel_teleop` is published.
From the first direction on, while a person is present and drives by directions, `driver_gone` is
published as false; otherwise the mux locks the planner, within its timeout even when this process
has died.

While the e-stop is engaged no intent is published. At its engagement and release, when the person
was absent, at the end of an episode and when planner, mux or world have fallen silent during a
drive, the input is discarded and the planner locked: the robot stands until a key is pressed anew.
A key that is held while the world or an episode begins counts from then on.
"""

import math
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, Vector3Stamped
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool

from serd_app.errors import TeleopError
from serd_app.teleop.page import hub as requests
from serd_app.teleop.page.hub import Hold, Joystick, Mode, Move, PageRequest
from serd_app.teleop.page.view import scene_of
from serd_app.teleop.session import DirectionChoice
from serd_core.grid.grid import Action
from serd_files.settings import setting, setting_of
from serd_ros.convert.diagnostics import values_of
from serd_ros.convert.motion import to_intent, to_joy, to_twist
from serd_ros.convert.stamp import Jump
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.episodes import PersonEpisodes
from serd_ros.endpoints.robot import ObservationSource
from serd_ros.nodes.watch_page import PageView, episode_values, serve_page
from serd_ros.process.serd_node import SerdNode
from serd_ros.settings import NO_NAMES, PageConfig
from serd_sim.episodes.episode import EpisodeSettings
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import STOP, Command
from serd_sim.world.epochs import HELD_S, epochs_in
from serd_sim.world.observation import Observation

_BEAT_PERIOD_S = 0.05
#: A longer pause (s) between two beats counts as absence: this process was stopped.
_ABSENCE_S = 0.5
#: The page is absent after this time (s) without a request.
_PAGE_SILENCE_S = 0.5
#: The mux and the world are silent after this time (s) without a message.
_SILENCE_S = 1.0


class TeleopPageConfig(PageConfig):
    """Parameters of teleop_page."""

    driver: str = setting("teleop_page", "name of the driver in the episode marks", min_length=1)
    mode: Mode = setting("directions", "directions: publish intent; velocity: cmd_vel_teleop")
    timeout_s: float = setting_of(EpisodeSettings, "timeout_s")
    required_nodes: tuple[str, ...] = setting(NO_NAMES, "an episode waits for these nodes")
    speed_mps: float = setting(0.6, "speed in velocity mode", unit="m/s", gt=0)
    turn_radps: float = setting(1.5, "turning rate in velocity mode", unit="rad/s", gt=0)


class TeleopPageNode(SerdNode[TeleopPageConfig]):
    """One page at a time drives; without its heartbeat the robot stops."""

    config_class = TeleopPageConfig

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        config, endpoints = self.config, self.endpoints
        scenario = self.scenario = load_scenario(config.scenario)
        self.mode: Mode = config.mode
        self.choice = DirectionChoice()
        self.observation: Observation | None = None
        self.episodes = PersonEpisodes(
            endpoints, scenario, config, notify=self.notify, on_end=self.stop_moving
        )
        self._was_present = self._is_driving = self._is_e_stopped = self._is_silent = False
        self._moving = self._was_released = self._has_gamepad = False
        self._is_guarded = True
        self._heard_s: float | None = None
        self._epochs = epochs_in(scenario)
        #: The newest intent, and since when it is the same.
        self._intent, self._since_s = Action.WAIT, -math.inf
        # Between the key of the emergency stop and the mux's answer a tap must not drive.
        self._wants_stop = False
        #: Whether the mux has an input, and since when it has none any more.
        self._is_driven, self._undriven_s = False, math.inf
        self._beat_s = self.wall_s()
        self._received_s: dict[str, float] = {}
        self._intents = endpoints.publisher(Vector3Stamped, topics.INTENT, qos.STATE)
        self._velocities = endpoints.publisher(Twist, topics.CMD_VEL_TELEOP, qos.COMMAND)
        self._gone = endpoints.publisher(Bool, topics.DRIVER_GONE, qos.COMMAND)
        self._e_stop = endpoints.publisher(Bool, topics.E_STOP, qos.COMMAND)
        self._override = endpoints.publisher(Bool, topics.GUARD_OVERRIDE, qos.COMMAND)
        self._joy = endpoints.publisher(Joy, topics.JOY, qos.COMMAND)
        period_s = scenario.control_period_s
        ObservationSource(endpoints, period_s, self._on_observation, on_jump=self._on_jump)
        endpoints.subscribe(DiagnosticArray, topics.DIAGNOSTICS, self._on_diagnostics, qos.STATE)
        endpoints.subscribe(Bool, topics.E_STOP_ENGAGED, self._on_e_stop, qos.LATCHED)
        endpoints.every(_BEAT_PERIOD_S, self._beat)
        self._view = PageView(scenario)
        self._view.subscribe(endpoints)
        scene = scene_of(scenario, self._view.grid)
        self._server = serve_page(self, scene, scenario)

    def notify(self, sentence: str) -> None:
        """Show it on the page and in the log."""
        self.get_logger().info(sentence)
        self._server.notify(sentence)

    def attend(self) -> bool:
        """Take the page's requests and send it the present state; whether a person is there."""
        if self._heard_s is not None and not self._is_there():
            # The mux has stopped the robot. What waits now was held before: it counts anew.
            self._heard_s = None
            self._interrupt()
        for request in self._server.take():
            self._obey(request)
        there = self._is_there()
        self._server.show(self._state(there=there))
        return there

    def _is_there(self) -> bool:
        return self._heard_s is not None and self.wall_s() - self._heard_s <= _PAGE_SILENCE_S

    def discard_input(self) -> None:
        """Let what is pressed now count only after it has been released and pressed again."""
        self.choice.clear()
        self._moving = self._was_released = False
        if self._has_gamepad:
            self._joy.publish(Joy())
            self._has_gamepad = False

    def _obey(self, request: PageRequest) -> None:
        if isinstance(request, requests.Away):
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
            held = request.direction
            self.choice.hold(None if held is None else Action[held.upper()])
        elif isinstance(request, Move):
            self._move(request)
        elif isinstance(request, Joystick):
            time_s = self.observation.time_s if self.observation is not None else 0.0
            self._joy.publish(to_joy(request.axes, request.buttons, time_s))
            self._has_gamepad = True
        elif isinstance(request, requests.Override):
            # It is to be repeated within the override_timeout of the guard.
            self._override.publish(Bool(data=True))
        elif isinstance(request, requests.SetMode):
            self.set_mode(request.mode)
        elif isinstance(request, requests.EmergencyStop):
            self.set_e_stop(request.engaged)
        elif isinstance(request, requests.Episode):
            episodes = self.episodes
            steps = {"start": episodes.start, "save": episodes.save, "discard": episodes.discard}
            steps[request.do]()

    def _move(self, request: Move) -> None:
        """Drive while a direction is held; one stop when it is released, then nothing."""
        moving = request.linear != 0.0 or request.angular != 0.0
        self._was_released |= not moving
        if not self._was_released:
            return
        if self.mode == "velocity" and (moving or self._moving):
            linear_mps = request.linear * self.config.speed_mps
            command = Command(linear_mps, request.angular * self.config.turn_radps)
            self._velocities.publish(to_twist(command))
        self._moving = moving

    def _state(self, *, there: bool) -> dict[str, Any]:
        return {
            **self._view.state(self.observation, episode_values(self.episodes), self.wall_s()),
            "page": self._server.driving_page,
            "there": there,
            "mode": self.mode,
            "choice": self.choice.action.name.lower(),
        }

    def _on_jump(self, jump: Jump) -> None:
        """End every motion, but where an episode begins; a new session discards the counts."""
        self._view.clear()
        self._epochs.begin()
        if jump is Jump.BACKWARD or not self.episodes.session.is_starting:
            self.stop_moving()
        if jump is Jump.BACKWARD:
            self.notify("the clock fell back: a new session begins")
            self.episodes.begin_session()

    def set_e_stop(self, engaged: bool) -> None:
        """Engage the emergency stop, or release it."""
        self._wants_stop = engaged and not self._is_e_stopped
        if engaged:
            self.stop_moving()
        else:
            self.discard_input()
        self._e_stop.publish(Bool(data=engaged))

    def set_mode(self, mode: Mode) -> None:
        """Drive by directions or by velocities; the robot stops in between."""
        if mode != self.mode:
            self.stop_moving()
            self._epochs.begin()
            self.mode, self._is_driving = mode, False

    def _beat(self) -> None:
        late_s, self._beat_s = self.wall_s() - self._beat_s, self.wall_s()
        was_silent, self._is_silent = self._is_silent, self._hears_too_little()
        if late_s > _ABSENCE_S or was_silent != self._is_silent or self._planner_fell_silent():
            self._interrupt()
        is_guarded = (self._view.guard or {}).get("overridden") != str(True)
        if is_guarded != self._is_guarded:
            self.notify("the guard is on" if is_guarded else "the guard is OVERRIDDEN")
        self._is_guarded = is_guarded
        present = self.attend()
        if present and self.mode == "directions" and self._is_driving and not self._is_silent:
            self._gone.publish(Bool(data=False))
        if self._was_present and not present:
            self._interrupt()
        self._was_present = present

    def _interrupt(self) -> None:
        """Stop after an absence; before the first direction there is nothing to stop."""
        if self._is_driving or self.mode == "velocity":
            self.stop_moving()

    def _planner_fell_silent(self) -> bool:
        """Whether the mux has lost the planner, which drives by directions, for a while now."""
        if self.wall_s() - self._undriven_s <= _ABSENCE_S:
            return False
        self._undriven_s = math.inf
        return self.mode == "directions"

    def _hears_too_little(self) -> bool:
        """Whether a node that sent messages before is silent: it was stopped, and may continue."""
        return any(self.wall_s() - at_s > _SILENCE_S for at_s in self._received_s.values())

    def stop_moving(self) -> None:
        """End every motion of this driver; the next one needs a key that is pressed anew."""
        self.discard_input()
        if self.mode == "velocity":
            self._velocities.publish(to_twist(STOP))
            return
        # The lock remains until the next direction: a planner that continues after it was stopped
        # may have lost the intent to wait.
        self._is_driving = False
        self._gone.publish(Bool(data=True))
        if self._intent != Action.WAIT and self.observation is not None:
            self._publish_intent(Action.WAIT, self.observation)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        values = values_of(message, "teleop_mux")
        if values is None:
            return
        self._received_s["teleop_mux"] = self.wall_s()
        was_driven, self._is_driven = self._is_driven, bool(values.get("active"))
        if was_driven != self._is_driven:
            self._undriven_s = math.inf if self._is_driven else self.wall_s()

    def _on_e_stop(self, message: Bool) -> None:
        was_stopped, self._is_e_stopped = self._is_e_stopped, bool(message.data)
        if self._is_e_stopped or was_stopped:
            self._wants_stop = False
        if self._is_e_stopped:
            self.stop_moving()
        elif was_stopped:
            self.discard_input()

    def _on_observation(self, observation: Observation) -> None:
        if self.observation is None:
            self.notify("the world is running: drive, or start an episode")
        self.observation = observation
        self._received_s["world"] = self.wall_s()
        self.episodes.see(observation)
        if self.mode == "directions":
            self._decide(observation)

    def _decide(self, observation: Observation) -> None:
        if self.episodes.session.is_starting:
            self._epochs.begin()  # what is held now is for the first decision of the episode
            return
        begins = self._epochs.begins(observation)
        is_stopped = self._is_e_stopped or self._wants_stop
        if not self._was_present or is_stopped or self.episodes.other_driver:
            return
        action = self.choice.action
        # Waiting to begin is no decision to wait.
        decides = action != Action.WAIT or (self.episodes.is_running and self.episodes.n_decisions)
        if action != self._intent or (begins and decides):
            self._publish_intent(action, observation)
        if begins and decides:
            self._begin_epoch(observation.time_s)
        elif action != self._epochs.action and observation.time_s - self._since_s >= HELD_S:
            self._epochs.interrupt(self._since_s)
            if decides:
                self._begin_epoch(self._since_s)

    def _begin_epoch(self, time_s: float) -> None:
        self._epochs.take(time_s, self._intent)
        self.episodes.n_decisions += self.episodes.is_running

    def _publish_intent(self, action: Action, observation: Observation) -> None:
        self._intents.publish(to_intent(action, observation.time_s))
        if action != self._intent:
            self._intent, self._since_s = action, observation.time_s
        self._is_driving |= action != Action.WAIT
