"""Fits in a thread of its own, so that the caller's thread stays free meanwhile."""

import threading
from collections.abc import Callable
from queue import Empty, SimpleQueue

from serd_app.learning.fit_data import FitProgress, ProgressCallback
from serd_app.learning.outcome import FitOutcome
from serd_bag.errors import FileError
from serd_core.errors import SerdError
from serd_files.errors import USER_ERRORS

_STOP_TIMEOUT_S = 10.0

Job = Callable[[ProgressCallback], FitOutcome]
Event = FitProgress | FitOutcome | SerdError | FileError


class FitStoppedError(SerdError):
    """The fit was stopped before its end."""


class FitWorker:
    """One job at a time; `events` returns its progress in the caller's thread."""

    def __init__(self) -> None:
        self._events: SimpleQueue[Event | BaseException] = SimpleQueue()
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def busy(self) -> bool:
        """Whether a job has begun whose end was not returned by `events` yet."""
        return self._thread is not None

    def begin(self, job: Job) -> None:
        """Run it; the outcome, or the error that ended it, is the last of its events."""
        self._thread = threading.Thread(target=self._run, args=(job,), daemon=True)
        self._thread.start()

    def events(self) -> list[Event]:
        """Everything since the last call; raises an error of the job that is no SerdError."""
        fetched: list[Event] = []
        while True:
            try:
                event = self._events.get_nowait()
            except Empty:
                return fetched
            if not isinstance(event, FitProgress):
                self._thread = None
            if isinstance(event, BaseException) and not isinstance(event, USER_ERRORS):
                raise event
            fetched.append(event)

    def stop(self) -> None:
        """End the job at its next step and wait for that."""
        self._stopped.set()
        if self._thread is not None:
            self._thread.join(_STOP_TIMEOUT_S)

    def _run(self, job: Job) -> None:
        try:
            self._events.put(job(self._report))
        except BaseException as error:
            self._events.put(error)

    def _report(self, progress: FitProgress) -> None:
        if self._stopped.is_set():
            raise FitStoppedError("learning was stopped; start the learner again to continue")
        self._events.put(progress)
