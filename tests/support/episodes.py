"""Rows of the table of episodes."""

import math

from serd_files.table import EpisodeResult


def episode_result(
    episode: int, outcome: str, time_of_arrival_s: float = math.nan, **changes: float | str
) -> EpisodeResult:
    """An episode of a learned policy among people, without contacts unless given."""
    values = {
        "seed": 7,
        "driver": "learned",
        "start_area": "train",
        "duration_s": 30.0,
        "distance_m": 11.2,
        "robot_on_person": 0,
        "person_on_robot": 0,
        "robot_on_wall": 0,
        "minimum_person_distance_m": 0.5,
        "wall_s": 1.0,
    }
    return EpisodeResult(
        episode=episode,
        outcome=outcome,
        time_of_arrival_s=time_of_arrival_s,
        **(values | changes),  # type: ignore[arg-type]
    )
