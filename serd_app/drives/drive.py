"""What a recording or live topics hold of a drive: poses, intents, and episodes by their marks.

Everything is on one clock. An episode whose own end is not recorded is cut off at the first gap in
the poses after its start: after it, the poses may belong to another episode. Without a gap it is
cut off at the mark that cannot be its own, or at the last pose.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from serd_bag.errors import BagError
from serd_bag.messages.plain import diagnostic_array
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.decisions import HIDDEN
from serd_core.grid.grid import action_of_direction

#: Topics of our recorder; EPISODE is also the name of the status in its messages.
POSE, INTENT, EPISODE = "robot_pose", "intent", "episode"
START, END = "start", "end"
SAVED, DISCARDED = "saved", "discarded"
#: Of marks.
OUTCOMES = ("", "arrived", "timeout", "aborted", SAVED, DISCARDED)
CUT_OFF, RETURN = "cut_off", "return"
NOT_FINITE = "direction not finite"
LONGEST_GAP_S = 0.5
NO_PAUSES: FloatArray = np.zeros(0)
#: In place of an action: no command is in force from then on.
SILENCE = HIDDEN - 1
_MOST_DIGITS = 9


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


@dataclass(frozen=True)
class EpisodeSpan:
    """One episode.

    outcome: arrived, timeout, aborted, saved, discarded, or cut_off where no end is recorded;
    unmarked, or return for a way back from the goal, which demonstrates nothing. ended_by: gap,
    goal, stop or turn where it was cut there; empty at the end of a recording and at marks.
    """

    number: int
    start_s: float
    end_s: float
    outcome: str
    ended_by: str = ""

    @property
    def demonstrates(self) -> bool:
        """Whether it is to be learned from."""
        return self.outcome not in (DISCARDED, RETURN)


@dataclass(frozen=True, eq=False)
class RecordedDrive:
    """pose_time_s (T,) increasing, position_m (T, 2); intent_time_s, intent_action (N,).

    intent_action: `Action`, `HIDDEN` or `SILENCE`. intent_hold_s: how long an intent is in force
    where no other one comes; None for the patience of the driver.
    n_bad_poses: poses left out because a number in them is not finite; n_bad_commands: velocity
    commands likewise.
    n_unplaced_poses: those left out because no transform was recorded about their time.
    dropped: intents that are none already, by why.
    longest_gap_s: between two poses across which the place is still interpolated.
    minimum_speed_mps: mean speed from which on the robot moves.
    cuts: how many episodes without marks end at a gap, a goal, a stop or a turn.
    way_time_s, way_m: (M,) times and (M, 2) ways of the second after each, as commanded or driven;
    none where intents are actions already.
    """

    pose_time_s: FloatArray
    position_m: FloatArray
    intent_time_s: FloatArray
    intent_action: IntArray
    episodes: tuple[EpisodeSpan, ...]
    source: str = ""
    n_bad_poses: int = 0
    n_unplaced_poses: int = 0
    n_bad_commands: int = 0
    dropped: Mapping[str, int] = field(default_factory=dict)
    intent_hold_s: float | None = None
    longest_gap_s: float = LONGEST_GAP_S
    minimum_speed_mps: float = 0.05
    cuts: Mapping[str, int] = field(default_factory=dict)
    way_time_s: FloatArray = field(default_factory=lambda: np.zeros(0))
    way_m: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))

    @property
    def with_hidden_actions(self) -> "RecordedDrive":
        """The drive with a hidden action for each episode in place of its intents."""
        return replace(self, **hidden_intents(self.episodes), dropped={})


def hidden_intents(spans: tuple[EpisodeSpan, ...]) -> dict[str, Any]:
    """Fields of a drive: an intent for each episode, without its action."""
    return {
        "intent_time_s": np.array([span.start_s for span in spans], dtype=np.float64),
        "intent_action": np.full(len(spans), HIDDEN, dtype=np.int64),
        "intent_hold_s": np.inf,
        "way_time_s": np.zeros(0),
        "way_m": np.zeros((0, 2)),
    }


def places_at(at_s: FloatArray, time_s: FloatArray, position_m: FloatArray) -> FloatArray:
    """(N, 2) places at (N,) times between (T,) poses; those at the ends before and after them."""
    return np.stack([np.interp(at_s, time_s, axis) for axis in position_m.T], axis=1)


def source_of(bag: str | Path) -> str:
    """What tables call a bag: its path as given, since many bags have one name."""
    return f"bag {Path(bag)}"


def finite_poses(rows: FloatArray, source: str) -> FloatArray:
    """The (N, n) rows in which every number is finite; BagError where that is none of them."""
    finite = np.isfinite(rows).all(axis=1)
    if len(rows) and not finite.any():
        raise BagError(
            f"{source} must hold poses that are finite, none of its {len(rows)} is; look at what"
            " published them"
        )
    return rows[finite]


def actions_of_directions(directions: FloatArray) -> IntArray:
    """(N,) actions that finite (N, 2) directions east and north mean."""
    actions = [action_of_direction(float(east), float(north)) for east, north in directions]
    return np.array(actions, dtype=np.int64)


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


def _number(values: dict[str, str]) -> int:
    text = values.get("episode", "")
    if not text.isdecimal() or len(text) > _MOST_DIGITS:
        raise BagError(
            f"episode mark must carry the episode's number, of at most {_MOST_DIGITS} digits, got"
            f" {text!r}; look at what published it"
        )
    return int(text)


def spans_of_marks(
    marks: Iterable[EpisodeMark], pose_time_s: FloatArray, longest_gap_s: float
) -> tuple[EpisodeSpan, ...]:
    """The episodes in order; marks that were sent again count once. pose_time_s: (T,) increasing.

    A second end mark with the number of an episode that has ended, whenever it comes, discards that
    episode or saves it after all. An episode whose number was there before is another one, and is
    given the number after the highest.
    """
    found = _Spans(pose_time_s, longest_gap_s)
    for mark in sorted(dict.fromkeys(marks), key=lambda each: each.time_s):
        found.take(mark)
    found.cut_off(float(pose_time_s[-1]) if len(pose_time_s) else 0.0)
    return tuple(span for _, span in found.closed)


def without_pauses(
    spans: Iterable[EpisodeSpan], pose_time_s: FloatArray, pauses_s: FloatArray
) -> tuple[EpisodeSpan, ...]:
    """The episodes, each in two where the recorder was paused: nobody knows what was driven and
    commanded then. pauses_s: (P,) times on the clock of the poses.

    What follows the pause belongs to the episode where its end is recorded.
    """
    found = list(spans)
    for pause_s in pauses_s[pauses_s > pose_time_s[:1].min(initial=np.inf)]:
        after = int(np.searchsorted(pose_time_s, pause_s))
        until_s, from_s = pose_time_s[after - 1], pose_time_s[after : after + 1]
        for row, span in enumerate(found):
            if span.demonstrates and span.start_s <= until_s and pause_s < span.end_s:
                found[row] = replace(span, end_s=float(until_s), outcome=CUT_OFF)
                if len(from_s) and span.outcome != CUT_OFF:
                    number = 1 + max(each.number for each in found)
                    rest = replace(span, number=number, start_s=float(from_s[0]))
                    found.insert(row + 1, rest)
                break
    return tuple(found)


class _Spans:
    """closed: the number that was marked, and the episode."""

    def __init__(self, pose_time_s: FloatArray, longest_gap_s: float) -> None:
        gaps = np.flatnonzero(np.diff(pose_time_s) > longest_gap_s)
        self._gap_start_s, self._gap_end_s = pose_time_s[gaps], pose_time_s[gaps + 1]
        self._open: EpisodeMark | None = None
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
        is_new = start.episode not in self._numbers
        number = start.episode if is_new else max(self._numbers) + 1
        self._numbers.add(number)
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
