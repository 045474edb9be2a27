"""One person's episodes: start, arrive or save or discard, as marks that cut the recording.

    idle -> starting -> running -> ended -> starting -> ...

Arrival and timeout end an episode by themselves. `save` ends one before its goal (aborted);
`discard` ends it as discarded, or takes back one that has just ended with a second end mark.
"""

from dataclasses import dataclass
from typing import Literal

from sim.episodes.progress import EpisodeProgress
from sim.scenario.scenario import Scenario
from sim.world.observation import Observation
from teleop.errors import TeleopError

Phase = Literal["idle", "starting", "running", "ended"]
START, END = "start", "end"
ABORTED, DISCARDED = "aborted", "discarded"
_CLOCK_ROUNDING_S = 1e-6


@dataclass(frozen=True)
class EpisodeEvent:
    """A mark to publish; outcome: arrived, timeout, aborted or discarded, empty at the start."""

    event: str
    time_s: float
    outcome: str = ""


class Session:
    """Follows the observations; what it returns is to be published. timeout_s: simulated."""

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

    def start(self) -> None:
        """Somebody asked for an episode; the world is being reset."""
        if self.phase in ("starting", "running"):
            raise TeleopError("an episode is running; save or discard it first")
        self.phase, self.outcome, self._progress = "starting", "", None

    def began(self, start_s: float) -> None:
        """The world has been reset; observations from start_s on are the episode's."""
        self._start_s = start_s
        self.phase = "running"

    def see(self, observation: Observation) -> tuple[EpisodeEvent, ...]:
        """Take the next observation."""
        self._newest_s = observation.time_s
        if self.phase != "running" or observation.time_s < self._start_s - _CLOCK_ROUNDING_S:
            return ()
        if self._progress is None:
            self._progress = EpisodeProgress(self._scenario, observation, self._timeout_s)
            return (EpisodeEvent(START, observation.time_s),)
        ending = self._progress.see(observation)
        return () if ending is None else (self._end(ending, observation.time_s),)

    def save(self) -> EpisodeEvent | None:
        """Keep the episode; None when it has already ended and is kept anyway."""
        if self.phase == "ended" and self.outcome != DISCARDED:
            return None
        self._require_running("save")
        return self._end(ABORTED, self._newest_s)

    def discard(self) -> EpisodeEvent:
        """Throw away the running episode, or the one that has just ended."""
        if self.phase != "ended" or self.outcome == DISCARDED:
            self._require_running("discard")
        return self._end(DISCARDED, self._newest_s)

    def _require_running(self, what: str) -> None:
        if self.phase != "running" or self._progress is None:
            raise TeleopError(f"there is no episode to {what}; start one first")

    def _end(self, outcome: str, time_s: float) -> EpisodeEvent:
        self.phase, self.outcome = "ended", outcome
        return EpisodeEvent(END, time_s, outcome)
