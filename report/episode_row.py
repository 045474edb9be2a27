"""One row of the episodes table: how one drive of the learned policy ended."""

from dataclasses import dataclass
from typing import Literal, get_args

from report.checks import finite_number
from report.errors import ReportError

EpisodeOutcome = Literal["arrived", "timeout", "aborted"]


@dataclass(frozen=True)
class EpisodeRow:
    """One drive; `time_of_arrival_s` is None unless the robot arrived."""

    episode: int
    seed: int
    outcome: EpisodeOutcome
    time_of_arrival_s: float | None
    path_length_m: float
    robot_on_person_contacts: int = 0
    person_on_robot_contacts: int = 0
    wall_contacts: int = 0

    def __post_init__(self) -> None:
        if self.outcome not in get_args(EpisodeOutcome):
            raise ReportError(
                f"outcome of episode {self.episode} must be one of "
                f"{', '.join(get_args(EpisodeOutcome))}, got {self.outcome!r}: fix the table."
            )
        if (self.outcome == "arrived") != (self.time_of_arrival_s is not None):
            raise ReportError(
                f"time_of_arrival_s of episode {self.episode} must be given exactly if it arrived, "
                f"got {self.time_of_arrival_s} with outcome {self.outcome!r}: use None otherwise."
            )
        if self.time_of_arrival_s is not None:
            finite_number(f"time_of_arrival_s of episode {self.episode}", self.time_of_arrival_s)
        finite_number(f"path_length_m of episode {self.episode}", self.path_length_m)

    @property
    def arrived(self) -> bool:
        """True if the robot reached the goal area in time."""
        return self.outcome == "arrived"
