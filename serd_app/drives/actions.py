"""Actions by a mapping: intents, or directions of commands or of the motion itself.

Velocity: a command acts after `delay_s` and holds until the next, at most `hold_s`. Turned by the
robot's heading and averaged over the second that follows, as far as commands hold in it, it is the
direction of the action, WAIT below `minimum_speed_mps`. While no command holds there is no action,
which need not mean to wait.
Motion: the direction from the place of the robot to that one second later, WAIT below
`minimum_speed_mps` on average. Hidden: no action. What velocities and motion mean is computed ten
times a second, and stated as an intent where it changes.
"""

from array import array
from dataclasses import dataclass
from typing import Any

import numpy as np

from serd_app.drives.drive import (
    NOT_FINITE,
    SILENCE,
    EpisodeSpan,
    actions_of_directions,
    hidden_intents,
    places_at,
)
from serd_app.drives.fields import VECTORS, VELOCITIES, field_reader
from serd_app.drives.mapping import BagMapping, TableMapping
from serd_bag.errors import BagError
from serd_bag.messages.times import TimesOnClock, placed_s
from serd_bag.topic import RawMessage, Topic
from serd_core.arrays import FloatArray, IntArray

_AHEAD_S, _STEP_S = 1.0, 0.1
_STAMP_TOLERANCE_S = 1e-6
_CARRIED = {
    "intent": (VECTORS, "a vector"),
    "velocity": (VELOCITIES, "a twist, or the speed of a steered vehicle,"),
}


@dataclass(frozen=True, eq=False)
class PoseTrack:
    """log_s, time_s (T,), time_s increasing; poses (T, 3) in the frame of the grid."""

    log_s: FloatArray
    time_s: FloatArray
    poses: FloatArray

    def at(self, time_s: FloatArray) -> FloatArray:
        """(N, 2) places, those at the ends before and after them."""
        return places_at(time_s, self.time_s, self.poses[:, :2])

    def placed(self, log_s: FloatArray, stamp_s: FloatArray) -> FloatArray:
        """(N,) times on the clock of the poses of a topic's messages; stamps 0 without one."""
        if np.array_equal(self.log_s, self.time_s):  # then all is placed by its receipt
            return log_s
        return placed_s(TimesOnClock(self.log_s, self.time_s).of(log_s), stamp_s)


#: Fields of a `RecordedDrive`: intent_time_s, intent_action (N,) and more.
Intents = dict[str, Any]


class MappedActions:
    """Collects the messages of the action topic."""

    def __init__(self, mapping: BagMapping, topic: Topic, source: str) -> None:
        shapes, wanted = _CARRIED[mapping.action_from]
        self.topics = frozenset({topic.name})
        self._read = field_reader(topic, mapping.action_fields, shapes, "action_fields", wanted)
        self._source, self._rows = source, array("d")

    @property
    def has_messages(self) -> bool:
        """Whether a message was taken."""
        return bool(self._rows)

    def take(self, message: RawMessage) -> None:
        """One of them; BagError where it is damaged."""
        header, (x, *others) = self._read(message.data)
        times_s = message.log_time_ns / 1e9, header.stamp_ns / 1e9
        self._rows.extend((*times_s, x, others[0] if others else 0.0))

    def intents(
        self, mapping: BagMapping, track: PoseTrack, spans: tuple[EpisodeSpan, ...]
    ) -> Intents:
        """The intents by a mapping of this topic; BagError where it has no message."""
        at_s, vectors, n_unclear = self.stated(track)
        if mapping.action_from == "velocity":
            found = intents_of_velocities(
                spans,
                command_time_s=at_s + mapping.delay_s,
                command_mps=vectors,
                pose_time_s=track.time_s,
                yaw_rad=track.poses[:, 2],
                hold_s=mapping.hold_s or np.inf,
                minimum_speed_mps=mapping.minimum_speed_mps,
                waits_in_silence=mapping.silence == "wait",
            )
            return found | {"n_bad_commands": n_unclear}
        dropped = {NOT_FINITE: n_unclear} if n_unclear else {}
        actions = actions_of_directions(vectors)
        return {"intent_time_s": at_s, "intent_action": actions, "dropped": dropped}

    def stated(self, track: PoseTrack) -> tuple[FloatArray, FloatArray, int]:
        """Times (N,) on the clock of the poses, vectors (N, 2), and how many more are not finite,
        of messages that were sent again one; BagError where the topic has no message."""
        rows = np.array(self._rows).reshape(-1, 4)
        if not len(rows):
            raise BagError(
                f"{self._source}: action_topic {', '.join(self.topics)} must hold messages, it"
                " holds none; name the topic in the mapping that the robot was driven by, or set"
                " action_from: hidden"
            )
        at_s = track.placed(rows[:, 0], rows[:, 1])
        rows = np.column_stack([at_s, rows[:, 2:]])[np.argsort(at_s, kind="stable")]
        sent_again = (rows[1:] == rows[:-1]).all(axis=1)
        rows = rows[np.append(True, ~sent_again)]
        clear = np.isfinite(rows[:, 1:]).all(axis=1)
        return rows[clear, 0], rows[clear, 1:], int((~clear).sum())


def posed_intents(
    mapping: BagMapping | TableMapping, track: PoseTrack, spans: tuple[EpisodeSpan, ...]
) -> Intents:
    """Intents of poses alone: hidden, or by the motion."""
    if mapping.action_from == "hidden":
        return hidden_intents(spans)
    asked = _Seconds(spans)
    moved_m = track.at(asked.end_s) - track.at(asked.begin_s)
    least_m = mapping.minimum_speed_mps * (asked.end_s - asked.begin_s)
    return asked.intents(actions_of_ways(moved_m, least_m), moved_m)


class _Seconds:
    """begin_s, end_s (N,): the second that follows each time at which actions are computed.

    It ends with its episode.
    """

    def __init__(self, spans: tuple[EpisodeSpan, ...]) -> None:
        begins_s = [
            np.arange(span.start_s, span.end_s - _STAMP_TOLERANCE_S, _STEP_S) for span in spans
        ]
        counts = [len(each) for each in begins_s]
        self.begin_s = np.concatenate([np.zeros(0), *begins_s])
        ends_s = np.repeat([span.end_s for span in spans], counts)
        self.end_s = np.minimum(self.begin_s + _AHEAD_S, ends_s)
        self._episode = np.repeat(np.arange(len(spans)), counts)

    def intents(self, action: IntArray, way_m: FloatArray) -> Intents:
        """Of the actions (N,), those that are another one than before, or the first of an episode;
        each is in force until the next. way_m: (N, 2) that is commanded."""
        changed = np.diff(action, prepend=SILENCE - 1) != 0
        changed |= np.diff(self._episode, prepend=-1) != 0
        return {
            "intent_time_s": self.begin_s[changed],
            "intent_action": action[changed],
            "intent_hold_s": np.inf,
            "way_time_s": self.begin_s,
            "way_m": way_m,
        }


def intents_of_velocities(
    spans: tuple[EpisodeSpan, ...],
    *,
    command_time_s: FloatArray,
    command_mps: FloatArray,
    pose_time_s: FloatArray,
    yaw_rad: FloatArray,
    hold_s: float = 0.5,
    minimum_speed_mps: float = 0.05,
    waits_in_silence: bool = False,
) -> Intents:
    """What velocity commands mean; without one the robot stands, if it waits in silence.

    command_mps (C, 2): forward and left in the robot's frame; yaw_rad (T,) at pose_time_s.
    """
    asked = _Seconds(spans)
    until_s = np.minimum(np.append(command_time_s[1:], np.inf), command_time_s + hold_s)
    # Between two edges one command acts; a robot that turns has another heading between the next.
    edges_s = np.unique(np.concatenate([asked.begin_s, asked.end_s, command_time_s, until_s]))
    edges_s = edges_s[np.isfinite(edges_s)]
    middle_s = (edges_s[:-1] + edges_s[1:]) / 2.0
    row = np.searchsorted(command_time_s, middle_s, side="right")  # counted from 1, 0: before all
    held = middle_s < np.append(-np.inf, until_s)[row]
    ahead, left = np.where(held[:, None], np.vstack([np.zeros(2), command_mps])[row], 0.0).T
    yaw = np.interp(middle_s, pose_time_s, np.unwrap(yaw_rad))
    mps = np.stack(
        [np.cos(yaw) * ahead - np.sin(yaw) * left, np.sin(yaw) * ahead + np.cos(yaw) * left], 1
    )
    way_m = np.vstack([np.zeros(2), np.cumsum(mps * np.diff(edges_s)[:, None], axis=0)])
    begin, end = (np.searchsorted(edges_s, each) for each in (asked.begin_s, asked.end_s))
    held |= waits_in_silence
    held_s = np.append(0.0, np.cumsum(np.diff(edges_s) * held))
    asked_m = way_m[end] - way_m[begin]
    actions = actions_of_ways(asked_m, minimum_speed_mps * (held_s[end] - held_s[begin]))
    return asked.intents(np.where(held[begin], actions, SILENCE), asked_m)


def actions_of_ways(way_m: FloatArray, least_m: FloatArray) -> IntArray:
    """(N,) action of each way (N, 2) east and north, WAIT where it is shorter than least_m (N,)."""
    length_m = np.hypot(*way_m.T)
    moves = ((length_m >= least_m) & (length_m > 0.0))[:, None]
    return actions_of_directions(
        np.divide(way_m, length_m[:, None], out=np.zeros_like(way_m), where=moves)
    )
