"""What the keys of a terminal do: commands, directions, and velocities as teleop_twist_keyboard.

    u i o      forward to the left, forward, forward to the right
    j k l      turn left, stop, turn right
    m , .      backward

q/z: 10 % more or less of both speeds, w/x: of the linear one, e/c: of the angular one. Any other
key stops. A terminal does not report when a key is released, so a key counts for a short time and
key repeat renews it.
"""

import math
from enum import Enum
from typing import Literal

from serd_core.grid.grid import Action
from serd_sim.world.command import STOP, Command

#: The two ways to drive by hand.
Mode = Literal["directions", "velocity"]


class KeyCommand(Enum):
    """Commands of keys that do not drive."""

    START = "start an episode"
    SAVE = "save the episode"
    DISCARD = "discard the episode"
    E_STOP = "E-STOP engaged"
    RELEASE = "e-stop released"
    SWITCH_MODE = "switch between directions and velocities"


KEY_COMMANDS = {
    "enter": KeyCommand.START,
    "s": KeyCommand.SAVE,
    "d": KeyCommand.DISCARD,
    "space": KeyCommand.E_STOP,
    "r": KeyCommand.RELEASE,
    "tab": KeyCommand.SWITCH_MODE,
}

#: Held, it overrides the guard; so does a letter that drives while Shift is held.
OVERRIDE_KEY = "g"
KEY_DIRECTIONS = {
    "up": Action.NORTH,
    "right": Action.EAST,
    "down": Action.SOUTH,
    "left": Action.WEST,
    "w": Action.WAIT,
}

HELP = """\
  arrow keys   next move: up is north; w takes it back
  u i o  j k l  m , .   drive by velocities (Tab switches), q/z w/x e/c change the speeds
  g, or Shift with a letter that drives: override the guard while held
  Enter start   s save   d discard   SPACE e-stop   r release   Ctrl-C end"""


class DirectionChoice:
    """The direction chosen for the next decision period, else wait.

    A tap counts for one period. A held key counts as long as it is held; one that is released
    before the period begins counts as a tap. Held keys count once none has been held since the
    start, or since `clear`.
    """

    def __init__(self) -> None:
        self._tapped = Action.WAIT
        self._held: Action | None = None
        self._was_released = False

    @property
    def upcoming(self) -> Action:
        """The action if the period began now."""
        return self._held if self._held is not None else self._tapped

    def tap(self, action: Action) -> None:
        """Choose for the next period; WAIT withdraws an earlier choice."""
        self._tapped = action

    def hold(self, action: Action | None) -> None:
        """Set the direction that is held now, None for none; repeated calls change nothing."""
        if action is None:
            self._was_released = True
        if not self._was_released:
            return
        if action is not None and action != self._held:
            self._tapped = action
        self._held = action

    def clear(self) -> None:
        """Reset to wait; a key that is held now counts after it has been released."""
        self._tapped, self._held, self._was_released = Action.WAIT, None, False

    def decide(self) -> Action:
        """The action of the period that begins now."""
        action, self._tapped = self.upcoming, Action.WAIT
        return action


#: Longer (s) than any keyboard waits before it repeats a held key.
_REPEAT_DELAY_S = 0.7


class KeyPresses:
    """Whether a key of a terminal counts: after `require_release` only when it was pressed anew.

    A terminal does not report when a key is released; a pause that is longer than the delay of key
    repeat is taken for it.
    """

    def __init__(self) -> None:
        self._last_s = -math.inf
        self._waits_for_release = False

    def require_release(self) -> None:
        """Ignore the keys that are held now."""
        self._waits_for_release = True

    def admit(self, now_s: float) -> bool:
        """Process a key that arrived now; whether it counts."""
        if now_s - self._last_s > _REPEAT_DELAY_S:
            self._waits_for_release = False
        self._last_s = now_s
        return not self._waits_for_release


_MOVES = {
    "i": (1, 0), "o": (1, -1), "j": (0, 1), "l": (0, -1), "u": (1, 1),
    ",": (-1, 0), ".": (-1, 1), "m": (-1, -1),
}  # fmt: skip
SHIFTED_MOVES = frozenset("IOJLUM")
_FACTORS = {
    "q": (1.1, 1.1), "z": (0.9, 0.9), "w": (1.1, 1.0), "x": (0.9, 1.0), "e": (1.0, 1.1),
    "c": (1.0, 0.9),
}  # fmt: skip


class VelocityKeys:
    """speed_mps, turn_radps: initial speeds; timeout_s: how long a key counts."""

    def __init__(self, speed_mps: float, turn_radps: float, timeout_s: float) -> None:
        self.speed_mps, self.turn_radps = speed_mps, turn_radps
        self._timeout_s = timeout_s
        self._move = (0, 0)
        self._pressed_s: float | None = None

    def press(self, key: str, now_s: float) -> None:
        """Process a key."""
        if key in _FACTORS:
            linear, angular = _FACTORS[key]
            self.speed_mps *= linear
            self.turn_radps *= angular
        else:
            self._move = _MOVES.get(key, (0, 0))
            self._pressed_s = now_s

    def release(self) -> None:
        """Let the last key count no longer."""
        self._pressed_s = None

    def command(self, now_s: float) -> Command | None:
        """The command to send now; one stop after the timeout, then None."""
        if self._pressed_s is None:
            return None
        if not 0.0 <= now_s - self._pressed_s <= self._timeout_s:
            self._pressed_s = None
            return STOP
        linear, angular = self._move
        return Command(linear * self.speed_mps, angular * self.turn_radps)
