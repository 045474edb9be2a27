"""What is recorded so far, counted from the episode marks of all drivers."""

from dataclasses import dataclass

from teleop.session import DISCARDED, END, START


@dataclass(frozen=True)
class RunningEpisode:
    """An episode that has begun and not ended."""

    number: int
    driver: str


class EpisodeTally:
    """The last end mark of an episode counts: a discarded one may have arrived before."""

    def __init__(self) -> None:
        self.running: RunningEpisode | None = None
        self._outcomes: dict[int, str] = {}

    def hear(self, event: str, number: int, driver: str, outcome: str) -> None:
        """Take a mark."""
        if event == START:
            self.running = RunningEpisode(number, driver)
        elif event == END:
            self._outcomes[number] = outcome
            if self.running is not None and self.running.number == number:
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
        """Episodes thrown away."""
        return sum(outcome == DISCARDED for outcome in self._outcomes.values())

    def __str__(self) -> str:
        """The counts in words."""
        return f"{self.kept} kept ({self.arrived} arrived), {self.discarded} discarded"
