"""One row of the table of episodes, from what the driver saw and the world reported."""

import math
from collections.abc import Mapping

from serd_ros.convert.reset_reply import ResetReply
from sim.episodes.progress import Ending, EpisodeProgress
from storage.episode_table import EpisodeResult


def episode_result(
    begun: ResetReply,
    progress: EpisodeProgress,
    report: Mapping[str, str],
    *,
    driver: str,
    outcome: Ending,
    reason: str,
    wall_s: float,
) -> EpisodeResult:
    """The row; report: values of `hallway_sim` on `diagnostics`, as text."""
    duration_s = progress.duration_s
    return EpisodeResult(
        episode=begun.episode,
        seed=begun.seed,
        driver=driver,
        start_area=begun.start_area,
        outcome=outcome,
        time_of_arrival_s=duration_s if outcome == "arrived" else math.nan,
        duration_s=duration_s,
        distance_m=progress.distance_m,
        robot_on_person=int(report["robot_on_person"]),
        person_on_robot=int(report["person_on_robot"]),
        robot_on_wall=int(report["robot_on_wall"]),
        minimum_person_distance_m=float(report["minimum_person_distance_m"]),
        wall_s=wall_s,
        reason=reason,
    )
