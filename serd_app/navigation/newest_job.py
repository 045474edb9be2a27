"""Work in a thread of its own, of which the newest alone counts: planning for the newest goal."""

import os
import sys
import threading
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Any


class NewestJob:
    """Runs one job after the other; of those that wait, and of results, the newest alone is kept.

    `begin` and `poll` are called by one thread. niceness: of the thread of the jobs, on Linux.
    """

    def __init__(self, niceness: int = 0) -> None:
        self._niceness = niceness
        self._lock = threading.Lock()
        self._waiting: tuple[int, Callable[[], Any]] | None = None
        self._is_running = False
        self._number = 0
        self._done: SimpleQueue[tuple[int, Any]] = SimpleQueue()

    def begin(self, job: Callable[[], Any]) -> None:
        """Run a job as soon as the one that runs has ended, unless a newer one comes."""
        self._number += 1
        with self._lock:
            self._waiting = self._number, job
            if not self._is_running:
                self._is_running = True
                threading.Thread(target=self._run, daemon=True).start()

    def forget(self) -> None:
        """Drop what waits and runs."""
        self._number += 1
        with self._lock:
            self._waiting = None

    def poll(self) -> Any:
        """The result of the newest job, or the exception that it raised; None until it is there."""
        while True:
            try:
                number, result = self._done.get_nowait()
            except Empty:
                return None
            if number == self._number:
                return result

    def _run(self) -> None:
        if self._niceness and sys.platform == "linux":  # where threads have one of their own
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), self._niceness)
        while True:
            with self._lock:
                if self._waiting is None:
                    self._is_running = False
                    return
                number, job = self._waiting
                self._waiting = None
            try:
                result = job()
            except Exception as error:
                result = error
            self._done.put((number, result))
