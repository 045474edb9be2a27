"""Waiting for conditions: on a busy machine a test takes longer, its result stays the same."""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

Found = TypeVar("Found")
#: Guard against a test that hangs, s. It is no measurement: a condition normally holds in seconds.
PATIENCE_S = 600.0
#: The same guard in a world in lock-step, which names the topics without commands before that.
LOCKSTEP_TIMEOUT_S = 300.0


def wait_until(
    condition: Callable[[], Found],
    *,
    turn: Callable[[], object] = lambda: time.sleep(0.05),
    seen: Callable[[], object] = lambda: "",
) -> Found:
    """The first true value of the condition.

    turn: called between two looks; seen: what the error shows when the condition never holds.
    """
    deadline_s = time.monotonic() + PATIENCE_S
    while not (found := condition()):
        assert time.monotonic() < deadline_s, f"not within {PATIENCE_S:g} s: {seen()}"
        turn()
    return found


class ProcessorWait:
    """How long threads have been runnable without a processor since this object was made, s.

    Linux counts this time for each thread, and the time that the host of a virtual machine has
    given to others (steal). A limit on what a program does in real time holds for the time it was
    given a processor; a busy machine adds the rest. The threads are those of this process and of
    all its descendants.
    """

    def __init__(self) -> None:
        self._before_ns, self._stolen_before_s = _waited_ns(), _stolen_s()

    @property
    def total_s(self) -> float:
        """The sum over all threads."""
        waits = (now - self._before_ns.get(thread, 0) for thread, now in _waited_ns().items())
        return sum(waits) * 1e-9 + _stolen_s() - self._stolen_before_s


def children_of(pid: int) -> list[int]:
    """Ids of the processes that the threads of this one have started."""
    lists = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(each) for path in lists for each in _text_of(path).split()]


def _descendants_of(pid: int) -> list[int]:
    return [each for child in children_of(pid) for each in (child, *_descendants_of(child))]


def _waited_ns() -> dict[str, int]:
    """Thread id to the time it has waited for a processor so far."""
    found = {}
    for pid in (os.getpid(), *_descendants_of(os.getpid())):
        for task in Path(f"/proc/{pid}/task").glob("*/schedstat"):
            text = _text_of(task)
            if text:
                found[task.parent.name] = int(text.split()[1])
    return found


def _stolen_s() -> float:
    """Steal time of all processors, the eighth number of the first line of /proc/stat."""
    return int(_text_of(Path("/proc/stat")).split()[8]) / os.sysconf("SC_CLK_TCK")


def _text_of(path: Path) -> str:
    """Empty where the process or thread has ended meanwhile."""
    try:
        return path.read_text()
    except OSError:
        return ""
