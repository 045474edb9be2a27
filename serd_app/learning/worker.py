"""Learns in a thread of its own, so that the node keeps listening meanwhile."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from queue import SimpleQueue

from serd_app.learning.recipe import Lesson, Told
from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import Step
from serd_core.errors import SerdError
from serd_core.grid.navigation import FEATURE_NAMES

_STOPPING_S = 10.0


@dataclass(frozen=True, eq=False)
class Progress:
    """The step just taken, of which start."""

    start: int
    step: Step

    @property
    def weights(self) -> FloatArray:
        """(F,) reward weights, with which the vector of a tied belief begins."""
        return self.step.vector[: len(FEATURE_NAMES)]


class LessonStoppedError(SerdError):
    """The node ends while it learns."""


Job = Callable[[Told], Lesson]
Event = Progress | Lesson | BaseException


class LessonWorker:
    """One job at a time; what happens is fetched with `events` from the node's own thread."""

    def __init__(self) -> None:
        self._events: SimpleQueue[Event] = SimpleQueue()
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def busy(self) -> bool:
        """Whether a job has begun whose end was not fetched yet."""
        return self._thread is not None

    def begin(self, job: Job) -> None:
        """Run it; the lesson, or the error it ended with, is the last of its events."""
        self._thread = threading.Thread(target=self._run, args=(job,), daemon=True)
        self._thread.start()

    def events(self) -> list[Event]:
        """Everything since the last call; a mistake of ours is raised."""
        fetched: list[Event] = []
        while not self._events.empty():  # nobody else takes from it
            fetched.append(self._events.get_nowait())
        if fetched and not isinstance(fetched[-1], Progress):
            self._thread = None
        for event in fetched:
            if isinstance(event, BaseException) and not isinstance(event, SerdError):
                raise event
        return fetched

    def stop(self) -> None:
        """End the job at its next step and wait for that."""
        self._stopped.set()
        if self._thread is not None:
            self._thread.join(_STOPPING_S)

    def _run(self, job: Job) -> None:
        try:
            self._events.put(job(self._told))
        except BaseException as error:
            self._events.put(error)

    def _told(self, start: int, step: Step) -> None:
        if self._stopped.is_set():
            raise LessonStoppedError("learning was stopped; start the learner again to go on")
        self._events.put(Progress(start, step))
