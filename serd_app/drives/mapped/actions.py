"""Actions by a mapping: intents, or directions of commands, of waypoints or of the motion itself.

Velocity: a command acts after `delay_s` and holds until the next, at most `hold_s`. Turned by the
robot's heading and averaged over a decision period it is the direction of the action, WAIT below
`minimum_speed_mps`. A period in which no command holds has no action, which need not mean to wait.
Waypoint: the direction from the robot to it, WAIT where it is nearer than `reached_m`.
Motion: the direction from the place of the robot to that one period later, WAIT below
`minimum_speed_mps` on average. Hidden: no action, at the same times.
"""

from array import array
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from serd_app.drives.episode_spans import EpisodeSpan
from serd_app.drives.mapped.mapping import BagMapping, TableMapping
from serd_app.drives.recorded_drive import NOT_FINITE, RecordedDrive, actions_of_directions
from serd_bag.errors import BagError
from serd_bag.messages.fields import POSES, VECTORS, VELOCITIES, FieldReader, field_reader
from serd_bag.messages.times import TimesOnClock, placed_s
from serd_bag.topic import RawMessage, Topic
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.demonstrations.decisions import HIDDEN
from serd_core.grid.grid import Action, action_of_direction

NO_COMMAND = "no command recorded then"
_STAMP_TOLERANCE_S = 1e-6
_CARRIED = {
    "intent": (VECTORS, "a vector"),
    "velocity": (VELOCITIES, "a twist, or the speed of a steered vehicle,"),
    "waypoint": (POSES, "a pose"),
}


@dataclass(frozen=True, eq=False)
class PoseTrack:
    """log_s, time_s (T,), time_s increasing; poses (T, 3) in the frame of the grid."""

    log_s: FloatArray
    time_s: FloatArray
    poses: FloatArray

    def at(self, time_s: FloatArray) -> FloatArray:
        """(N, 2) places, those at the ends before and after them."""
        columns = [np.interp(time_s, self.time_s, each) for each in self.poses[:, :2].T]
        return np.stack(columns, axis=1)

    def placed(self, log_s: FloatArray, stamp_s: FloatArray) -> FloatArray:
        """(N,) times on the clock of the poses of a topic's messages; stamps 0 without one."""
        if np.array_equal(self.log_s, self.time_s):  # then all is placed by its receipt
            return log_s
        return placed_s(TimesOnClock(self.log_s, self.time_s).of(log_s), stamp_s)


@dataclass(frozen=True, eq=False)
class MappedIntents:
    """time_s, action (N,); dropped and n_bad_commands: see `RecordedDrive`."""

    time_s: FloatArray
    action: IntArray
    dropped: dict[str, int] = field(default_factory=dict)
    n_bad_commands: int = 0


class MappedActions:
    """Collects the messages of the action topic; topic: None where none has actions."""

    def __init__(self, mapping: BagMapping, topic: Topic | None, source: str) -> None:
        self._mapping, self._source = mapping, source
        self._rows = array("d")
        self._read: FieldReader | None = None
        self.topics: frozenset[str] = frozenset()
        if topic is not None:
            shapes, wanted = _CARRIED[mapping.action_from]
            self.topics = frozenset({topic.name})
            self._read = field_reader(topic, mapping.action_fields, shapes, "action_fields", wanted)

    def under(self, mapping: BagMapping) -> "MappedActions":
        """The same messages with another hold, delay, silence or least speed."""
        other = copy(self)
        other._mapping = mapping
        return other

    def take(self, message: RawMessage) -> None:
        """One of them; BagError where it is damaged."""
        assert self._read is not None
        header, (x, *others) = self._read(message.data)
        times_s = message.log_time_ns / 1e9, header.stamp_ns / 1e9
        self._rows.extend((*times_s, x, others[0] if others else 0.0))

    def intents(
        self, track: PoseTrack, spans: tuple[EpisodeSpan, ...], period_s: float
    ) -> MappedIntents:
        """The decisions; BagError where the topic has no message."""
        if self._read is None:
            return posed_intents(self._mapping, track, spans, period_s)
        mapping = self._mapping
        at_s, vectors, n_unclear = self.stated(track)
        if mapping.action_from != "velocity":
            dropped = {NOT_FINITE: n_unclear} if n_unclear else {}
            if mapping.action_from == "intent":
                return MappedIntents(at_s, actions_of_directions(vectors), dropped)
            actions = actions_of_waypoints(
                position_m=track.at(at_s), waypoint_m=vectors, reached_m=mapping.waypoint_reached_m
            )
            return MappedIntents(at_s, actions, dropped)
        decided_s = decision_times(spans, period_s)
        actions, commanded = actions_of_velocities(
            decision_time_s=decided_s,
            period_s=period_s,
            command_time_s=at_s + mapping.delay_s,
            command_mps=vectors,
            pose_time_s=track.time_s,
            yaw_rad=track.poses[:, 2],
            hold_s=mapping.hold_s or np.inf,
            minimum_speed_mps=mapping.minimum_speed_mps,
        )
        if mapping.silence == "wait":
            commanded = np.ones_like(commanded)
        n_silent = int((~commanded).sum())
        dropped = {NO_COMMAND: n_silent} if n_silent else {}
        return MappedIntents(decided_s[commanded], actions[commanded], dropped, n_unclear)

    @property
    def n_taken(self) -> int:
        """Messages so far."""
        return len(self._rows) // 4

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
        at_s, vectors = rows[:, 0], rows[:, 1:]
        clear = np.isfinite(vectors).all(axis=1)
        return at_s[clear], vectors[clear], int((~clear).sum())


def posed_intents(
    mapping: BagMapping | TableMapping,
    track: PoseTrack,
    spans: tuple[EpisodeSpan, ...],
    period_s: float,
) -> MappedIntents:
    """Decisions of poses alone: hidden, or by the motion, which is where the robot is at the end of
    the period or of its episode."""
    if mapping.action_from == "hidden":
        return hidden_intents(spans, period_s)
    ends = [np.full(len(decision_times((span,), period_s)), span.end_s) for span in spans]
    start_s = decision_times(spans, period_s)
    end_s = np.minimum(start_s + period_s, np.concatenate(ends) if ends else start_s)
    actions = actions_of_waypoints(
        position_m=track.at(start_s),
        waypoint_m=track.at(end_s),
        reached_m=mapping.minimum_speed_mps * period_s,
    )
    return MappedIntents(start_s, actions)


def hidden_intents(spans: tuple[EpisodeSpan, ...], period_s: float) -> MappedIntents:
    """A decision every period, without its action."""
    time_s = decision_times(spans, period_s)
    return MappedIntents(time_s, np.full(len(time_s), HIDDEN, dtype=np.int64))


def with_hidden_actions(drive: RecordedDrive, period_s: float) -> RecordedDrive:
    """The drive without its intents: a decision every period from the start of each episode."""
    found = hidden_intents(drive.episodes, period_s)
    return replace(drive, intent_time_s=found.time_s, intent_action=found.action, dropped={})


def decision_times(spans: tuple[EpisodeSpan, ...], period_s: float) -> FloatArray:
    """(N,) every period from the start of each episode."""
    ticks = [np.arange(span.start_s, span.end_s - _STAMP_TOLERANCE_S, period_s) for span in spans]
    return np.concatenate(ticks) if ticks else np.zeros(0)


def actions_of_velocities(
    *,
    decision_time_s: FloatArray,
    period_s: float,
    command_time_s: FloatArray,
    command_mps: FloatArray,
    pose_time_s: FloatArray,
    yaw_rad: FloatArray,
    hold_s: float = 0.5,
    minimum_speed_mps: float = 0.05,
) -> tuple[IntArray, BoolArray]:
    """(N,) action of the period that begins at each decision time, (N,) whether a command held.

    command_mps (C, 2): forward and left in the robot's frame; yaw_rad (T,) at pose_time_s.
    """
    unwrapped_rad = np.unwrap(yaw_rad)
    until_s = np.minimum(np.append(command_time_s[1:], np.inf), command_time_s + hold_s)
    actions, commanded = [], []
    for start_s in decision_time_s:
        first_s = np.maximum(command_time_s, start_s)
        last_s = np.minimum(until_s, start_s + period_s)
        held = last_s > first_s
        commanded.append(bool(held.any()))
        # A robot that turns under a long command has another heading in each period.
        middle_s = (first_s[held] + last_s[held]) / 2.0
        yaw = np.interp(middle_s, pose_time_s, unwrapped_rad)
        share = (last_s - first_s)[held] / period_s
        ahead, left = command_mps[held].T
        east = float(share @ (np.cos(yaw) * ahead - np.sin(yaw) * left))
        north = float(share @ (np.sin(yaw) * ahead + np.cos(yaw) * left))
        actions.append(_action(east, north, minimum_speed_mps))
    return np.array(actions, dtype=np.int64), np.array(commanded, dtype=bool)


def actions_of_waypoints(
    *, position_m: FloatArray, waypoint_m: FloatArray, reached_m: float
) -> IntArray:
    """(N,) action for the robot at (N, 2) sent to the waypoints (N, 2)."""
    offsets = waypoint_m - position_m
    actions = [_action(float(east), float(north), reached_m) for east, north in offsets]
    return np.array(actions, dtype=np.int64)


def _action(east: float, north: float, least: float) -> Action:
    length = float(np.hypot(east, north))
    if length < least or length == 0.0:
        return Action.WAIT
    return action_of_direction(east / length, north / length)
