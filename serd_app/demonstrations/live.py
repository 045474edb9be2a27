"""Decisions from messages as they come: the same as from a bag of them, whatever the pace."""

from dataclasses import dataclass, field, replace

from serd_app.demonstrations.demonstrations import Demonstrations, with_drive
from serd_app.demonstrations.discretise import DiscretisationReport
from serd_app.drives.episode_spans import CUT_OFF
from serd_app.drives.sessions import DriveSessions
from serd_core.grid.grid import Grid


@dataclass(eq=False)
class LiveDrive:
    """Collects robot_pose, intent and episode, raw; `gathered` says what they amount to.

    earlier: what was known before.
    """

    source: str
    grid: Grid
    decision_period_s: float
    earlier: Demonstrations | None = None
    report: DiscretisationReport | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self._heard = DriveSessions(self.source)

    def take(self, topic: str, data: bytes) -> None:
        """One message of `robot_pose`, `intent` or `episode`; BagError for one that is damaged."""
        self._heard.take(topic, data)

    @property
    def n_ended(self) -> int:
        """End marks of episodes that came so far."""
        return self._heard.n_ended

    @property
    def n_late(self) -> int:
        """Intents that came after the end mark of their episode."""
        return self._heard.n_late

    @property
    def caught_up(self) -> bool:
        """Whether the robot's poses have come as far as the newest end of an episode."""
        return self._heard.caught_up

    def gathered(self, *, unfinished: bool = True) -> Demonstrations:
        """All episodes so far; `report` then tells of those of the last session.

        unfinished: also what there is of the episode that is still being driven.
        """
        found = self.earlier
        *before, last = (session.builder.drive() for session in self._heard.sessions)
        if not unfinished and last.episodes and last.episodes[-1].outcome == CUT_OFF:
            last = replace(last, episodes=last.episodes[:-1])
        for drive in (*before, last):
            found, self.report = with_drive(found, drive, self.grid, self.decision_period_s)
        assert found is not None
        return found
