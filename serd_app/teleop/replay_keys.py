"""The keys of a terminal that steer a replay: space, right, up and down."""

import sys
from enum import Enum

from serd_app.teleop.terminal import KeyNames, RawTerminal

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
