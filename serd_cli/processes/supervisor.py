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
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from honcho.manager import SIGNALS, SYSTEM_PRINTER_NAME, Manager
from honcho.printer import Message
from honcho.process import Popen
from honcho.process import Process as Keeper

from serd_cli.errors import BAD_INPUT, FAILED, RunError
from serd_ros.process.progress import parse_progress

Line = Callable[[str, str], None]
_KEPT_LINES = 15
_ENDING_S = 25.0
_LOOK_PERIOD_S = 0.5
#: How long (s) a node may take to end by itself after the command was killed.
_GRACE_S = 0.8
_PR_SET_PDEATHSIG = 1


@dataclass(frozen=True)
class Process:
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
        data = (
            message.data.decode(errors="replace")
            if isinstance(message.data, bytes)
            else message.data
        )
        for line in data.splitlines():
            if message.name == SYSTEM_PRINTER_NAME:
                continue
            if parse_progress(line) is None:
                self.take(message.name, line)
            else:  # it would displace the lines that name what failed
                self._on_line(message.name, line)

    def take(self, name: str, line: str) -> None:
        """Keep and pass on a line about a process."""
        self.tails.setdefault(name, deque(maxlen=_KEPT_LINES)).append(line)
        self._on_line(name, line)


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


def _is_stopped(pid: int) -> bool:
    """Whether a process is in the state T of /proc."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "T"
    except OSError:
        return False


class _Manager(Manager):
    """honcho's manager that survives a signal before all processes have started.

    honcho kills after 5 s, in which a busy machine may not have closed a bag.
    """

    _stop_when_started = False
    _looked_s = 0.0
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
        if started and time.monotonic() - self._looked_s > _LOOK_PERIOD_S:
            self._looked_s = time.monotonic()
            self._name_stopped()
        return started

    def _name_stopped(self) -> None:
        """Print which processes were stopped by a signal, as SIGSTOP, and which were continued."""
        for name, process in self._processes.items():
            is_stopped = "returncode" not in process and _is_stopped(process["pid"])
            if is_stopped != process.get("is_stopped", False):
                process["is_stopped"] = is_stopped
                sentence = (
                    f"was stopped by a signal; continue it with: kill -CONT {process['pid']}"
                    if is_stopped
                    else "was continued"
                )
                self._printer.take(name, f"{name} {sentence}")

    def exit_codes(self) -> dict[str, int]:
        """Exit code of each process, in the order they ended."""
        return {
            name: process["returncode"]
            for name, process in self._processes.items()
            if "returncode" in process
        }


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
    if manager.returncode:
        sentence = _what_failed(manager.exit_codes(), manager.returncode, tap.tails)
        raise RunError(sentence, BAD_INPUT if manager.returncode == BAD_INPUT else FAILED)


def _what_failed(codes: Mapping[str, int], code: int, tails: Mapping[str, deque[str]]) -> str:
    name = next(name for name, each in codes.items() if each == code)
    ending = f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"
    lines = [f"{name} {ending}; its last output:", *tails.get(name, ())]
    return f"{os.linesep}  ".join(lines) if len(lines) > 1 else f"{name} {ending}"
