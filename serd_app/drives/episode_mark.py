"""The start and the end of an episode, as drivers publish them on the topic `episode`."""

from dataclasses import dataclass

#: The topic, and the name of the status in its messages.
EPISODE = "episode"
START, END = "start", "end"
SAVED, DISCARDED = "saved", "discarded"
#: Of marks.
OUTCOMES = ("", "arrived", "timeout", "aborted", SAVED, DISCARDED)


@dataclass(frozen=True)
class EpisodeMark:
    """One mark.

    event: START or END; outcome: one of OUTCOMES, empty at the start. reason: why the driver gave
    up, empty where it did not.
    """

    event: str
    time_s: float
    episode: int
    driver: str = ""
    seed: int = 0
    start_area: str = ""
    outcome: str = ""
    reason: str = ""
