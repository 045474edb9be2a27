"""teleop_keyboard: a person drives with the keys of a terminal, as a ROS 2 node."""

import math
import sys

from serd_app.errors import TeleopError
from serd_app.teleop.keyboard import (
    HELP,
    KEY_COMMANDS,
    KEY_DIRECTIONS,
    OVERRIDE_KEY,
    SHIFTED_MOVES,
    KeyCommand,
    KeyPresses,
    VelocityKeys,
)
from serd_app.teleop.terminal import KeyNames, RawTerminal
from serd_ros.episodes.hand_driver import HandDriverNode
from serd_ros.graph.configs import TeleopKeyboardConfig


class TeleopKeyboardNode(HandDriverNode[TeleopKeyboardConfig]):
    """Reads keys, chooses directions or velocities, starts and ends episodes."""

    def __init__(self, kind: str) -> None:
        self._terminal: RawTerminal | None = None
        super().__init__(kind)
        config = self.config
        self._keys, self._presses = KeyNames(), KeyPresses()
        self._overridden_s = -math.inf
        self._velocity = VelocityKeys(config.speed_mps, config.turn_radps, config.key_timeout_s)
        self._terminal = RawTerminal(config.terminal)
        self.notify(f"driving by {self.mode}\n{HELP}")

    def close(self) -> None:
        """Restore the terminal."""
        if self._terminal is not None:
            self._terminal.close()

    def notify(self, sentence: str) -> None:
        """Print it; the terminal shows what this process writes to stderr."""
        print(sentence, file=sys.stderr, flush=True)

    def attend(self) -> bool:
        """Process the keys typed since; the person is present while the process runs."""
        if self._terminal is None:
            return False
        typed = self._terminal.read()
        if typed is None:
            self.finish(0)
            return False
        for key in self._keys.feed(typed):
            self._press(key)
        if self.wall_s() - self._overridden_s <= self.config.key_timeout_s:
            self.override_guard()
        command = self._velocity.command(self.wall_s())
        if command is not None and self.mode == "velocity":
            self.drive(command)
        return True

    def discard_input(self) -> None:
        """Discard choice and velocity; a key that repeats counts after a pause."""
        super().discard_input()
        self._presses.require_release()
        self._velocity.release()
        self._overridden_s = -math.inf

    def _press(self, key: str) -> None:
        overrides = key == OVERRIDE_KEY or (self.mode == "velocity" and key in SHIFTED_MOVES)
        if overrides:
            self._overridden_s = self.wall_s()
            key = key.lower()
        wanted = KEY_COMMANDS.get(key)
        if wanted is not None:
            self._obey(wanted)
        elif key == OVERRIDE_KEY or not self._presses.admit(self.wall_s()):
            return
        elif self.mode == "velocity":
            self._velocity.press(key, self.wall_s())
        elif key in KEY_DIRECTIONS:
            self.choice.tap(KEY_DIRECTIONS[key])

    def _obey(self, wanted: KeyCommand) -> None:
        try:
            if wanted is KeyCommand.START:
                self.episodes.start()
            elif wanted is KeyCommand.SAVE:
                self.episodes.save()
            elif wanted is KeyCommand.DISCARD:
                self.episodes.discard()
            elif wanted is KeyCommand.SWITCH_MODE:
                self.set_mode("velocity" if self.mode == "directions" else "directions")
                self.notify(f"driving by {self.mode}")
            else:
                self.set_e_stop(wanted is KeyCommand.E_STOP)
                self.notify(wanted.value)
        except TeleopError as error:
            self.notify(str(error))
