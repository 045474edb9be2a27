"""The start of an episode, and its row in the table of episodes."""

import math
from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

from pydantic import Field

from serd_files.table import EpisodeResult
from serd_files.yaml_config import StrictModel
from serd_sim.episodes.episode import Ending, EpisodeProgress, EpisodeRecord
from serd_sim.robot.contacts import ContactCounts

#: What a record and a row both have.
_OF_RECORD = {each.name for each in fields(EpisodeResult)} & {
    each.name for each in fields(EpisodeRecord)
}
#: Start area of an episode that began without a reset.
ANYWHERE = "anywhere"


class EpisodeStart(StrictModel):
    """An episode that begins now; observations before start_s belong to the one before.

    The service `reset` responds with it as JSON.
    """

    episode: int = Field(ge=0)
    seed: int = Field(ge=0)
    start_area: str
    start_s: float


def observed_result(
    start: EpisodeStart,
    progress: EpisodeProgress,
    report: Mapping[str, str],
    *,
    driver: str,
    outcome: Ending,
    reason: str,
    wall_s: float,
) -> EpisodeResult:
    """The row of an episode over ROS; report: values of `hallway_sim` on `diagnostics`, as text."""
    duration_s = progress.duration_s
    contacts: dict[str, Any] = {each.name: int(report[each.name]) for each in fields(ContactCounts)}
    return EpisodeResult(
        **start.model_dump(exclude={"start_s"}),
        driver=driver,
        outcome=outcome,
        time_of_arrival_s=duration_s if outcome == "arrived" else math.nan,
        duration_s=duration_s,
        distance_m=progress.distance_m,
        **contacts,
        minimum_person_distance_m=float(report["minimum_person_distance_m"]),
        wall_s=wall_s,
        reason=reason,
    )


def result_of_record(record: EpisodeRecord, *, reason: str, wall_s: float) -> EpisodeResult:
    """The row of an episode that was run in process; reason: why the driver gave up, or empty."""
    return EpisodeResult(
        **{name: getattr(record, name) for name in _OF_RECORD},
        **asdict(record.contacts),
        wall_s=wall_s,
        reason="" if record.outcome == "arrived" else reason,
    )
