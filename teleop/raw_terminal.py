"""A terminal that gives every key at once and echoes nothing, until it is closed.

Ctrl-C still ends the program. Ctrl-Z is switched off: a driver that sleeps cannot drive.
"""

import os
import select
import termios

from teleop.errors import TeleopError

_LOCAL_FLAGS = 3
_CONTROL = 6
_AT_ONCE = 4096


class RawTerminal:
    """Opens the device for itself, so that nobody else's reads and writes become non-blocking."""

    def __init__(self, device: str = "/dev/tty") -> None:
        try:
            self._fd = os.open(device, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as error:
            raise TeleopError(_no_terminal(device, error.strerror or "unreadable")) from None
        try:
            self._before = termios.tcgetattr(self._fd)
        except termios.error:
            os.close(self._fd)
            raise TeleopError(_no_terminal(device, "not a terminal")) from None
        self._open = True
        self._make_raw()

    def read(self) -> bytes | None:
        """What was typed since, b"" for nothing, None when the terminal has gone."""
        if not select.select([self._fd], [], [], 0.0)[0]:
            return b""
        try:
            return os.read(self._fd, _AT_ONCE) or None
        except BlockingIOError:
            return b""
        except OSError:
            return None

    def close(self) -> None:
        """Put the terminal back as it was; a second call does nothing."""
        if self._open:
            self._open = False
            try:
                termios.tcsetattr(self._fd, termios.TCSANOW, self._before)
            except termios.error:
                pass  # the terminal has been closed
            finally:
                os.close(self._fd)

    def __enter__(self) -> "RawTerminal":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _make_raw(self) -> None:
        settings = termios.tcgetattr(self._fd)
        settings[_LOCAL_FLAGS] &= ~(termios.ICANON | termios.ECHO)
        control = settings[_CONTROL]
        control[termios.VMIN], control[termios.VTIME] = 1, 0
        control[termios.VSUSP] = control[termios.VQUIT] = b"\x00"
        termios.tcsetattr(self._fd, termios.TCSANOW, settings)


def _no_terminal(device: str, why: str) -> str:
    return (
        f"terminal must be a terminal to read keys from, got {device} ({why})"
        "; start it in a terminal window"
    )
