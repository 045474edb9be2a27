"""Commands to the robot, and the dead-man's switch that they pass."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Command:
    """Wanted forward speed and turning rate (positive turns left), as geometry_msgs/Twist."""

    linear_mps: float
    angular_radps: float

    @property
    def is_finite(self) -> bool:
        """Whether both numbers can be driven."""
        return math.isfinite(self.linear_mps) and math.isfinite(self.angular_radps)


STOP = Command(linear_mps=0.0, angular_radps=0.0)


class CommandGuard:
    """Passes the last command on until it is too old; a command that is not finite is a stop."""

    def __init__(self, timeout_s: float = 0.5) -> None:
        self.timeout_s = timeout_s
        self.n_rejected = 0
        self._command = STOP
        self._received_s: float | None = None

    def receive(self, command: Command, time_s: float) -> None:
        """Take a new command that arrived now."""
        if not command.is_finite:
            self.n_rejected += 1
            command = STOP
        self._command = command
        self._received_s = time_s

    def is_stale(self, time_s: float) -> bool:
        """Whether nothing has arrived within the timeout; also when the clock went backwards."""
        if self._received_s is None:
            return True
        age = time_s - self._received_s
        return age > self.timeout_s + 1e-9 or age < 0.0

    def current(self, time_s: float) -> Command:
        """The command to drive now."""
        return STOP if self.is_stale(time_s) else self._command
