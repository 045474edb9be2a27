"""Whether the command that started this node's stack still lives.

A command that was killed with SIGKILL cannot end its nodes. They are told its process by an
environment variable and end when it is gone. Without the variable a node stands alone.
"""

import os
import select
from collections.abc import Mapping

from serd_ros.errors import NodeError

VARIABLE = "SERD_STARTED_BY"


class Starter:
    """The process of the environment variable, held by a descriptor that no reused pid deceives."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self._descriptor: int | None = None
        pid = environment.get(VARIABLE, "")
        if not pid:
            return
        if not pid.isdecimal():
            raise NodeError(f"{VARIABLE} must be a process id, got {pid!r}; unset it")
        try:
            self._descriptor = os.pidfd_open(int(pid))
        except ProcessLookupError:
            raise NodeError(f"{VARIABLE} names process {pid}, which has ended; unset it") from None

    @property
    def gone(self) -> bool:
        """Whether there was one and it has ended."""
        if self._descriptor is None:
            return False
        readable, _, _ = select.select([self._descriptor], [], [], 0)
        return bool(readable)

    def close(self) -> None:
        """Give the descriptor back."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None
