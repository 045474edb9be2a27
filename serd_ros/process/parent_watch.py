"""Whether the process that started this node has ended.

A command that is killed with SIGKILL cannot end its nodes. The environment variable names its
process, and nodes end with it. Without the variable a node depends on no other process.
"""

import os
import select
import signal
import threading
from collections.abc import Mapping

from serd_ros.errors import NodeError

VARIABLE = "SERD_STARTED_BY"
#: How long (s) a node may take to end by itself after its parent has ended.
_GRACE_S = 1.2


class ParentProcess:
    """The process that the environment variable names, held by a descriptor: pids are reused."""

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
    def has_ended(self) -> bool:
        """Whether the variable names a process and it has ended."""
        if self._descriptor is None:
            return False
        readable, _, _ = select.select([self._descriptor], [], [], 0)
        return bool(readable)

    def end_process_with_parent(self) -> None:
        """End this process soon after its parent, even while it imports, starts or computes.

        By SIGALRM; call it in the main thread.
        """
        if self._descriptor is not None:
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            watch = threading.Thread(target=_end_after, args=(self._descriptor,), daemon=True)
            watch.start()

    def close(self) -> None:
        """Close the descriptor."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def _end_after(descriptor: int) -> None:
    select.select([descriptor], [], [])
    # The kernel's timer needs neither a processor for this thread nor Python's lock.
    signal.setitimer(signal.ITIMER_REAL, _GRACE_S)
