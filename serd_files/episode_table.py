"""The table of driven episodes: one CSV row each, replaced atomically as a whole."""

import math
from dataclasses import dataclass
from pathlib import Path

from serd_bag.errors import FileError
from serd_files.table import OptionalFloat, read_rows


@dataclass(frozen=True)
class EpisodeResult:
    """How one episode ended; times in simulated seconds.

    time_of_arrival_s: NaN if the robot did not arrive; minimum_person_distance_m: NaN if not
    measured. wall_s: wall time from the first to the last
    observation, for the real-time factor. reason: why the driver gave up, empty otherwise.
    """

    episode: int
    seed: int
    driver: str
    start_area: str
    outcome: str
    time_of_arrival_s: OptionalFloat
    duration_s: float
    distance_m: float
    robot_on_person: int
    person_on_robot: int
    robot_on_wall: int
    minimum_person_distance_m: OptionalFloat
    wall_s: float
    reason: str = ""

    @property
    def arrived(self) -> bool:
        """Whether the robot reached the goal area in time."""
        return self.outcome == "arrived"


def load_episodes(path: str | Path) -> tuple[EpisodeResult, ...]:
    """All rows of a table; FileError names the line of a fault."""
    # Tables of the first version have no column `reason`.
    episodes = read_rows(path, EpisodeResult, optional=("reason",))
    for line, each in enumerate(episodes, start=2):
        if each.arrived == math.isnan(each.time_of_arrival_s):
            raise FileError(
                f"{path}: line {line}, time_of_arrival_s must be a number exactly if outcome is"
                f" 'arrived', got {each.time_of_arrival_s} and {each.outcome!r}; correct the line"
            )
        if each.arrived and not 0.0 <= each.time_of_arrival_s < math.inf:
            raise FileError(
                f"{path}: line {line}, time_of_arrival_s must be finite and not negative, got"
                f" {each.time_of_arrival_s}; correct the line"
            )
    return episodes
