"""Marks of episodes, and episodes from them: a start and an end, each with its number.

An episode whose own end is not recorded is cut off at the first gap in the poses after its start:
after it, the poses may belong to another episode. Without a gap it is cut off at the mark that
cannot be its own, or at the last pose.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from serd_bag.errors import BagError
from serd_bag.messages.plain import diagnostic_array
from serd_core.arrays import FloatArray

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


CUT_OFF, RETURN = "cut_off", "return"
_MOST_DIGITS = 9


@dataclass(frozen=True)
class EpisodeSpan:
    """One episode.

    outcome: arrived, timeout, aborted, saved, discarded, or cut_off where no end is recorded;
    unmarked, or return for a way back from the goal, which demonstrates nothing.
    """

    number: int
    start_s: float
    end_s: float
    outcome: str

    @property
    def demonstrates(self) -> bool:
        """Whether it is to be learned from."""
        return self.outcome not in (DISCARDED, RETURN)


def marks_of(data: bytes, time_ns: int | None = None) -> list[EpisodeMark]:
    """Those in a diagnostic_msgs/DiagnosticArray, with event, number and outcome alone.

    Other statuses are ignored. time_ns: in place of the stamp.
    """
    stamp_ns, statuses = diagnostic_array(data)
    time_s = (stamp_ns if time_ns is None else time_ns) / 1e9
    return [
        EpisodeMark(
            each.message, time_s, _number(each.values), outcome=each.values.get("outcome", "")
        )
        for each in statuses
        if each.name == EPISODE and each.message in (START, END)
    ]


def spans_of_marks(
    marks: Iterable[EpisodeMark], pose_time_s: FloatArray, longest_gap_s: float
) -> tuple[EpisodeSpan, ...]:
    """The episodes in order; marks that were sent again count once. pose_time_s: (T,) increasing.

    A second end mark with the number of an episode that has ended, whenever it comes, discards that
    episode or saves it after all. An episode whose number was
    there before is another one, and is given the number after the highest.
    """
    found = _Spans(pose_time_s, longest_gap_s)
    for mark in sorted(dict.fromkeys(marks), key=lambda each: each.time_s):
        found.take(mark)
    found.cut_off(float(pose_time_s[-1]) if len(pose_time_s) else 0.0)
    return tuple(span for _, span in found.closed)


class _Spans:
    """closed: the number that was marked, and the episode."""

    def __init__(self, pose_time_s: FloatArray, longest_gap_s: float) -> None:
        gaps = np.flatnonzero(np.diff(pose_time_s) > longest_gap_s)
        self._gap_start_s, self._gap_end_s = pose_time_s[gaps], pose_time_s[gaps + 1]
        self._open: EpisodeMark | None = None
        self._highest = -1
        self._numbers: set[int] = set()
        self.closed: list[tuple[int, EpisodeSpan]] = []

    def take(self, mark: EpisodeMark) -> None:
        """The next mark in time."""
        if mark.event == START:
            self.cut_off(mark.time_s)
            self._open = mark
        elif self._open is not None and mark.episode == self._open.episode:
            self._close(self._open, mark.time_s, mark.outcome)
        elif not (mark.outcome in (DISCARDED, SAVED) and self._judge_again(mark)):
            self.cut_off(mark.time_s)

    def cut_off(self, until_s: float) -> None:
        """The open episode, if any, ends at the first gap after its start, or then."""
        if self._open is None:
            return
        start_s = self._open.time_s
        gap = int(np.searchsorted(self._gap_end_s, start_s, side="right"))
        if gap < len(self._gap_start_s):
            until_s = min(until_s, float(self._gap_start_s[gap]))
        self._close(self._open, max(until_s, start_s), CUT_OFF)

    def _close(self, start: EpisodeMark, end_s: float, outcome: str) -> None:
        number = self._highest + 1 if start.episode in self._numbers else start.episode
        self._numbers.add(number)
        self._highest = max(self._highest, number)
        self.closed.append((start.episode, EpisodeSpan(number, start.time_s, end_s, outcome)))
        self._open = None

    def _judge_again(self, mark: EpisodeMark) -> bool:
        """Give the latest episode with the mark's number its outcome; whether there is one."""
        for row in reversed(range(len(self.closed))):
            number, span = self.closed[row]
            if number == mark.episode:
                self.closed[row] = number, replace(span, outcome=mark.outcome)
                return True
        return False


def _number(values: dict[str, str]) -> int:
    text = values.get("episode", "")
    if not text.isdecimal() or len(text) > _MOST_DIGITS:
        raise BagError(
            f"episode mark must carry the episode's number, of at most {_MOST_DIGITS} digits, got"
            f" {text!r}; look at what published it"
        )
    return int(text)
