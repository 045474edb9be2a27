"""Episodes driven by hand: started, ended, saved or discarded, as marks that cut the recording.

    idle -> starting -> running -> ended -> starting -> ...

Arrival and timeout end an episode. `save` ends one before its goal; `discard` ends it as discarded,
or withdraws one that has just ended by a second end mark. One that timed out is discarded unless it
is saved by a second end mark.
"""

from dataclasses import dataclass
from typing import Literal

from serd_app.drives.drive import DISCARDED, END, SAVED, START, EpisodeMark
from serd_app.errors import TeleopError
from serd_core.grid.grid import Action
from serd_sim.episodes.episode import EpisodeProgress
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation

Phase = Literal["idle", "starting", "running", "ended"]
TIMEOUT = "timeout"
_CLOCK_ROUNDING_S = 1e-6


@dataclass(frozen=True)
class EpisodeEvent:
    """A mark to publish; outcome: arrived, saved or discarded, empty at the start."""

    event: str
    time_s: float
    outcome: str = ""


class Session:
    """The state of one driver's episodes; returned events are to be published.

    timeout_s: simulated seconds after which an episode ends.
    """

    def __init__(self, scenario: Scenario, timeout_s: float) -> None:
        self.phase: Phase = "idle"
        self.outcome = ""
        self._scenario, self._timeout_s = scenario, timeout_s
        self._start_s = 0.0
        self._progress: EpisodeProgress | None = None
        self._newest_s = 0.0

    @property
    def duration_s(self) -> float:
        """Simulated seconds of the running episode, or of the last one."""
        return self._progress.duration_s if self._progress is not None else 0.0

    @property
    def is_starting(self) -> bool:
        """Whether an episode was begun whose first observation has not come."""
        return self.phase == "starting" or (self.phase == "running" and self._progress is None)

    @property
    def timed_out(self) -> bool:
        """Whether the last episode timed out and was not saved."""
        return self.outcome == TIMEOUT

    def start(self) -> None:
        """Begin an episode; the world is being reset."""
        if self.phase in ("starting", "running"):
            raise TeleopError("an episode is running; save or discard it first")
        self.phase, self.outcome, self._progress = "starting", "", None

    def world_reset(self, start_s: float) -> None:
        """Count observations from start_s on as the episode's."""
        self._start_s = start_s
        self.phase = "running"

    def observe(self, observation: Observation) -> tuple[EpisodeEvent, ...]:
        """Process the next observation; the events it causes."""
        self._newest_s = observation.time_s
        if self.phase != "running" or observation.time_s < self._start_s - _CLOCK_ROUNDING_S:
            return ()
        if self._progress is None:
            self._progress = EpisodeProgress(self._scenario, observation, self._timeout_s)
            return (EpisodeEvent(START, observation.time_s),)
        ending = self._progress.see(observation)
        if ending is None:
            return ()
        event = self._end(DISCARDED if ending == TIMEOUT else ending, observation.time_s)
        self.outcome = ending
        return (event,)

    def save(self) -> EpisodeEvent | None:
        """End the episode as saved, or keep one that timed out; None where it is kept already."""
        if self.phase != "ended" or self.outcome == DISCARDED:
            self._require_running("save")
        elif self.outcome != TIMEOUT:
            return None
        return self._end(SAVED, self._newest_s)

    def discard(self) -> EpisodeEvent:
        """Discard the running episode, or the one that has just ended."""
        if self.phase != "ended" or self.outcome in (DISCARDED, TIMEOUT):
            self._require_running("discard")
        return self._end(DISCARDED, self._newest_s)

    def _require_running(self, what: str) -> None:
        if self.phase != "running" or self._progress is None:
            raise TeleopError(f"there is no episode to {what}; start one first")

    def _end(self, outcome: str, time_s: float) -> EpisodeEvent:
        self.phase, self.outcome = "ended", outcome
        return EpisodeEvent(END, time_s, outcome)


class EpisodeTally:
    """Counts of the recorded episodes, from the episode marks of all drivers.

    The last end mark of an episode counts: a discarded one may have arrived before.
    """

    def __init__(self) -> None:
        #: The start mark of an episode that has not ended.
        self.running: EpisodeMark | None = None
        self._outcomes: dict[int, str] = {}

    def add(self, mark: EpisodeMark) -> None:
        """Count a mark."""
        if mark.event == START:
            self.running = mark
        elif mark.event == END:
            self._outcomes[mark.episode] = mark.outcome
            if self.running is not None and self.running.episode == mark.episode:
                self.running = None

    @property
    def kept(self) -> int:
        """Episodes that ended and were not discarded."""
        return len(self._outcomes) - self.discarded

    @property
    def arrived(self) -> int:
        """Episodes that reached the goal and were not discarded."""
        return sum(outcome == "arrived" for outcome in self._outcomes.values())

    @property
    def discarded(self) -> int:
        """Episodes that were discarded."""
        return sum(outcome == DISCARDED for outcome in self._outcomes.values())

    def __str__(self) -> str:
        """For example `3 kept (2 arrived), 1 discarded`."""
        return f"{self.kept} kept ({self.arrived} arrived), {self.discarded} discarded"


class DirectionChoice:
    """The direction that a person holds, else wait.

    After `clear`, a key counts when it is pressed anew. One that is held from the start on counts.
    """

    def __init__(self) -> None:
        self._held: Action | None = None
        self._counts = True

    @property
    def action(self) -> Action:
        """What the person wants now."""
        return Action.WAIT if self._held is None or not self._counts else self._held

    def hold(self, action: Action | None) -> None:
        """Set the direction that is held now, None for none; repeated calls change nothing."""
        self._held, self._counts = action, self._counts or action is None

    def clear(self) -> None:
        """Reset to wait; a key that is held now counts after it has been released."""
        self._held, self._counts = None, False
