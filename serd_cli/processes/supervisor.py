"""Runs the processes of a stack together with honcho: one ends, all end; Ctrl-C ends all.

A keeper, honcho's process between this one and each node, ends its node when this one is killed.
"""

import ctypes
import os
import shlex
import signal
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from honcho.manager import SIGNALS, SYSTEM_PRINTER_NAME, Manager
from honcho.printer import Message
from honcho.process import Popen
from honcho.process import Process as Keeper

from serd_cli.errors import BAD_INPUT, FAILED, RunError
from serd_ros.process.progress import parse_progress

Line = Callable[[str, str], None]
_KEPT_LINES = 15
_ENDING_S = 25.0
#: How long (s) a node may take to end by itself after the command was killed.
_GRACE_S = 0.8
_PR_SET_PDEATHSIG = 1


class Process(NamedTuple):
    """One process of a stack."""

    name: str
    command: Sequence[str]


class _Tap:
    """honcho's printer: passes each line on and keeps the last ones of each process."""

    width = 0

    def __init__(self, on_line: Line) -> None:
        self.tails: dict[str, deque[str]] = {}
        self._on_line = on_line

    def write(self, message: Message) -> None:
        if message.name == SYSTEM_PRINTER_NAME:
            return
        data = message.data
        for line in (
            data.decode(errors="replace") if isinstance(data, bytes) else data
        ).splitlines():
            if parse_progress(line) is None:  # it would displace the lines that name what failed
                self.tails.setdefault(message.name, deque(maxlen=_KEPT_LINES)).append(line)
            self._on_line(message.name, line)


def _signal_at_death_of(parent: int, number: signal.Signals) -> None:
    """The kernel sends this process a signal when its parent ends, or has ended already."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(number))
    if os.getppid() != parent:
        os.kill(os.getpid(), number)


class _Keeper(Keeper):
    """Passes on the lines of a node, and ends it after the command has ended without doing so.

    The node has the signal SIGTERM and 0.8 s, and is then killed. Where its keeper is killed, the
    kernel kills the node.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._command_pid = os.getpid()

    def run(self, events: Any = None, ignore_signals: bool = False) -> None:
        """honcho's, in a session of its own, so that a signal to the command's group spares it."""
        os.setsid()
        signal.signal(signal.SIGHUP, self._end_node)
        signal.signal(signal.SIGALRM, self._kill_node)
        _signal_at_death_of(self._command_pid, signal.SIGHUP)
        keeper_pid = os.getpid()
        self._child_ctor = partial(
            Popen, preexec_fn=lambda: _signal_at_death_of(keeper_pid, signal.SIGKILL)
        )
        super().run(events, ignore_signals)

    def _end_node(self, *_: object) -> None:
        if self._child is not None:
            self._child.terminate()
        signal.setitimer(signal.ITIMER_REAL, _GRACE_S)

    def _kill_node(self, *_: object) -> None:
        if self._child is not None:
            self._child.kill()
        os._exit(FAILED)  # the lines that are left are not read


class _Manager(Manager):
    """honcho's manager that survives a signal before all processes have started.

    honcho kills after 5 s, in which a busy machine may not have closed a bag.
    """

    _stop_when_started = False
    _ending_since_s: float | None = None

    def __init__(self, printer: _Tap) -> None:
        super().__init__(printer)
        self._process_ctor = _Keeper

    def terminate(self) -> None:
        """End all processes; once they have all been started."""
        if super()._all_started():
            super().terminate()
        else:
            self._stop_when_started = True

    def kill(self) -> None:
        """Kill the processes that have not ended some time after they were asked to."""
        now_s = time.monotonic()
        if self._ending_since_s is None:
            self._ending_since_s = now_s
        if now_s - self._ending_since_s > _ENDING_S:
            super().kill()

    def _all_started(self) -> bool:
        started = bool(super()._all_started())
        if started and self._stop_when_started:
            super().terminate()
        return started

    def exit_codes(self) -> dict[str, int]:
        """Exit codes of the processes that have ended."""
        ended = self._processes.items()
        return {name: each["returncode"] for name, each in ended if "returncode" in each}


def run_together(
    processes: Sequence[Process], environment: Mapping[str, str], on_line: Line
) -> None:
    """Run until one ends, then end the others; return when all have ended.

    on_line: called with (process name, line) for everything they print. Raises KeyboardInterrupt
    when interrupted, RunError with the last lines of a process that failed of itself.
    """
    tap = _Tap(on_line)
    manager = _Manager(tap)
    for process in processes:
        command = "exec " + shlex.join(process.command)
        manager.add_process(process.name, command, env=environment)
    before = {number: signal.getsignal(number) for number in (*SIGNALS, signal.SIGHUP)}
    # A window that is closed must not leave a robot running.
    signal.signal(signal.SIGHUP, lambda *_: os.kill(os.getpid(), signal.SIGTERM))
    try:
        manager.loop()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if manager.returncode in {entry["rc"] for entry in SIGNALS.values()}:
        raise KeyboardInterrupt
    if not (code := manager.returncode):
        return
    name = next(name for name, each in manager.exit_codes().items() if each == code)
    ending = f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"
    lines = tap.tails.get(name, ())
    last = f"{os.linesep}  ".join(["; its last output:", *lines]) if lines else ""
    raise RunError(f"{name} {ending}{last}", BAD_INPUT if code == BAD_INPUT else FAILED)
