"""Driving by velocities with the keys of teleop_twist_keyboard.

    u i o      forward to the left, forward, forward to the right
    j k l      turn left, stop, turn right
    m , .      backward

q/z: 10 % more or less of both speeds, w/x: of the linear one, e/c: of the angular one. Any other
key stops. A terminal does not tell when a key is let go, so a key counts for a short time and key
repeat keeps it alive.
"""

from sim.world.command import STOP, Command

_MOVES = {
    "i": (1, 0), "o": (1, -1), "j": (0, 1), "l": (0, -1), "u": (1, 1),
    ",": (-1, 0), ".": (-1, 1), "m": (-1, -1),
}  # fmt: skip
_FACTORS = {
    "q": (1.1, 1.1), "z": (0.9, 0.9), "w": (1.1, 1.0), "x": (0.9, 1.0), "e": (1.0, 1.1),
    "c": (1.0, 0.9),
}  # fmt: skip


class VelocityKeys:
    """speed_mps, turn_radps: at first; timeout_s: how long a key counts."""

    def __init__(self, speed_mps: float, turn_radps: float, timeout_s: float) -> None:
        self.speed_mps, self.turn_radps = speed_mps, turn_radps
        self._timeout_s = timeout_s
        self._move = (0, 0)
        self._pressed_s: float | None = None

    def press(self, key: str, now_s: float) -> None:
        """Take a key."""
        if key in _FACTORS:
            linear, angular = _FACTORS[key]
            self.speed_mps *= linear
            self.turn_radps *= angular
        else:
            self._move = _MOVES.get(key, (0, 0))
            self._pressed_s = now_s

    def command(self, now_s: float) -> Command | None:
        """What to send now; one stop when the key has become old, then None."""
        if self._pressed_s is None:
            return None
        if not 0.0 <= now_s - self._pressed_s <= self._timeout_s:
            self._pressed_s = None
            return STOP
        linear, angular = self._move
        return Command(linear * self.speed_mps, angular * self.turn_radps)
