"""A terminal in raw mode, the names of the keys in the bytes it sends, and keys of a replay.

Every key is delivered at once and nothing is echoed. Ctrl-C still ends the program; Ctrl-Z is off,
because a suspended process cannot stop the robot.
"""

import os
import select
import sys
import termios
from enum import Enum

from serd_app.errors import TeleopError

_LOCAL_FLAGS = 3
_CONTROL = 6
_AT_ONCE = 4096
_NAMED = {"\r": "enter", "\n": "enter", " ": "space", "\t": "tab", "\x7f": "backspace"}
_ARROWS = {"A": "up", "B": "down", "C": "right", "D": "left"}
_ESCAPE = "\x1b"


class RawTerminal:
    """Opens the device separately, so that other users of it keep blocking reads and writes."""

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
        """The bytes typed since the last call; None when the terminal has closed."""
        if not select.select([self._fd], [], [], 0.0)[0]:
            return b""
        try:
            return os.read(self._fd, _AT_ONCE) or None
        except BlockingIOError:
            return b""
        except OSError:
            return None

    def close(self) -> None:
        """Restore the terminal's settings; a second call does nothing."""
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


class KeyNames:
    """Converts bytes to key names: one character, or up, down, left, right, enter, ...

    The beginning of an escape sequence is kept until the rest arrives.
    """

    def __init__(self) -> None:
        self._rest = ""

    def feed(self, data: bytes) -> list[str]:
        """Keys that are complete; call it with b"" when nothing arrived, so that Escape counts."""
        text, self._rest = self._rest + data.decode("utf-8", errors="ignore"), ""
        keys: list[str] = []
        while text:
            key, text = _next(text)
            if key is None and data:
                self._rest = text
                break
            if key is None:
                key, text = "escape", ""
            if key:
                keys.append(key)
        return keys


def _next(text: str) -> tuple[str | None, str]:
    """First key and what follows it; None where an escape sequence is not complete yet.

    The key is empty for a sequence that is none of ours.
    """
    if text[0] != _ESCAPE:
        return _NAMED.get(text[0], text[0]), text[1:]
    if len(text) == 1 or (text[1] in "[O" and len(text) == 2):
        return None, text
    if text[1] not in "[O":
        return "escape", text[1:]
    end = 2
    while end < len(text) and not "@" <= text[end] <= "~":
        end += 1
    if end == len(text):
        return None, text
    known = _ARROWS.get(text[end], "") if end == 2 else ""
    return known, text[end + 1 :]


HELP = "space: pause, right: one message on (while paused), up and down: twice or half as fast"


class ReplayKey(Enum):
    """Commands of keys; values are the names of the keys."""

    PAUSE = "space"
    STEP = "right"
    FASTER = "up"
    SLOWER = "down"


RATE_FACTORS = {ReplayKey.FASTER: 2.0, ReplayKey.SLOWER: 0.5}


class ReplayKeys:
    """Reads keys at once and shows one line that stays; `close` restores the terminal."""

    def __init__(self) -> None:
        self._names, self._terminal = KeyNames(), RawTerminal()
        print(HELP, file=sys.stderr, flush=True)

    def typed(self) -> list[ReplayKey]:
        """Keys since the last call that mean something."""
        known = {key.value: key for key in ReplayKey}
        names = self._names.feed(self._terminal.read() or b"")
        return [known[name] for name in names if name in known]

    def show(self, line: str) -> None:
        """Put the line in the place of the last one."""
        print(f"\r{line:<60}", end="", file=sys.stderr, flush=True)

    def close(self) -> None:
        """Restore the terminal."""
        print(file=sys.stderr)
        self._terminal.close()
