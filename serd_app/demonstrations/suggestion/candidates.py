"""The likeliest topics of a bag for poses and commands, with their messages."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from bags.errors import BagError
from bags.reader import BagReader
from bags.topic import RawMessage, Topic, topics_named
from serd_app.demonstrations.grid.fitted_grid import grid_around
from serd_app.demonstrations.suggestion.names import (
    command_candidates,
    pose_candidates,
    robot_frames,
)
from serd_app.drives.episode_mark import EPISODE
from serd_app.drives.mapped.actions import MappedActions, PoseTrack
from serd_app.drives.mapped.drive import MappedMessages, mapped_messages
from serd_app.drives.mapped.mapping import BagMapping
from serd_app.drives.mapped.poses import MappedPoses
from serd_app.drives.recorded_drive import INTENT, POSE, RecordedDrive, source_of

PERIOD_S = 1.0
_CELL_SIZES_M = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0)
_MOST = 6
_FEWEST_POSES = 10
_SHORTEST_WAY_M = 0.2
_USUAL_SPEED_MPS = 0.05
#: Of the speed of the fastest tenth of the motion, from which on a slower robot moves.
_SLOW_SHARE = 1 / 3
_Made = TypeVar("_Made")


@dataclass(frozen=True, eq=False)
class PoseCandidate:
    """A pose topic that moves. mapping: with its pose keys alone."""

    topic: Topic
    mapping: BagMapping
    track: PoseTrack

    @property
    def way(self) -> str:
        """What of the robot's motion it shows."""
        span_s = self.track.time_s[-1] - self.track.time_s[0]
        way_m = float(np.hypot(*np.diff(self.track.poses[:, :2], axis=0).T).sum())
        number = len(self.track.time_s)
        return f"{number} poses in {span_s:.0f} s, {way_m:.1f} m ({self.topic.type_name})"


class Candidates:
    """Messages of the likeliest topics, collected in one pass over the bag.

    own: the messages of a recording of this project, None of another. actions: by topic, those with
    messages. rejected: why topics were left out.
    """

    def __init__(self, reader: BagReader) -> None:
        self._source, self._known = source_of(reader.path), reader.topics
        self._damaged: dict[str, BagError] = {}
        self.rejected: list[str] = []
        self._poses = self._readers(pose_candidates, self._pose_reader)
        self.actions = self._readers(command_candidates, self._action_reader)
        self.own = self._own_messages()
        self._collect(reader)
        self.actions = {name: each for name, each in self.actions.items() if each.n_taken}

    def poses(self) -> list[PoseCandidate]:
        """Those that move, the likeliest first."""
        found = [
            self._made(_pose_candidate, self._known[name], each)
            for name, each in self._poses.items()
        ]
        return [each for each in found if each is not None]

    def drive(self, mapping: BagMapping, period_s: float) -> RecordedDrive:
        """What `serd demos` takes from the bag by one of these mappings; BagError where it cannot,
        as with a damaged message."""
        messages = self.own if self.own and mapping == self.own.mapping else self._mapped(mapping)
        for name in sorted(self._damaged.keys() & messages.topics):
            raise self._damaged[name]
        return messages.drive(period_s)

    def _mapped(self, mapping: BagMapping) -> MappedMessages:
        poses = self._poses[mapping.pose_topic].under(mapping)
        if mapping.has_action_topic:
            actions = self.actions[mapping.action_topic].under(mapping)
        else:
            actions = MappedActions(mapping, None, self._source)
        return MappedMessages(mapping, self._source, poses, actions)

    def _own_messages(self) -> MappedMessages | None:
        if not all(topics_named(self._known, name) for name in (POSE, INTENT)):
            return None
        marks = EPISODE if topics_named(self._known, EPISODE) else ""
        try:
            return mapped_messages(self._known, BagMapping(episode_topic=marks), self._source)
        except BagError:  # as where several robots have these topics
            return None

    def _made(self, make: Callable[..., _Made], *arguments: object) -> _Made | None:
        """None, with the reason in `rejected`, where a rule of its kind is broken."""
        try:
            return make(*arguments)
        except BagError as error:
            self.rejected.append(str(error).removeprefix(f"{self._source}: "))
            return None

    def _readers(
        self, rank: Callable[[Iterable[Topic]], list[Topic]], make: Callable[[Topic], _Made]
    ) -> dict[str, _Made]:
        """By topic, of the likeliest ones."""
        found = {each.name: self._made(make, each) for each in rank(self._known.values())[:_MOST]}
        return {name: each for name, each in found.items() if each is not None}

    def _pose_reader(self, topic: Topic) -> MappedPoses:
        return MappedPoses(self._known, BagMapping(pose_topic=topic.name), self._source)

    def _action_reader(self, topic: Topic) -> MappedActions:
        mapping = BagMapping(action_from="velocity", action_topic=topic.name)
        return MappedActions(mapping, topic, self._source)

    def _collect(self, reader: BagReader) -> None:
        takers: dict[str, list[Callable[[RawMessage], None]]] = {}
        collected: list[MappedPoses | MappedActions | MappedMessages]
        collected = [*self._poses.values(), *self.actions.values()]
        collected += [self.own] if self.own else []
        for each in collected:
            for name in each.topics:
                takers.setdefault(name, []).append(each.take)
        for message in reader.messages(takers.keys() & self._known.keys()):
            for take in takers[message.topic]:
                self._take(take, message)

    def _take(self, take: Callable[[RawMessage], None], message: RawMessage) -> None:
        try:
            take(message)
        except BagError as error:
            self._damaged.setdefault(message.topic, error)


def _pose_candidate(topic: Topic, collected: MappedPoses) -> PoseCandidate:
    """BagError where it shows no motion of one robot."""
    mapping = BagMapping(pose_topic=topic.name)
    bodies = collected.tree.carried()
    frames = robot_frames(collected.tree.frames) or (bodies if len(bodies) == 1 else [])
    if collected.from_tf and frames:
        mapping = mapping.model_copy(update={"robot_frame": frames[0]})
    track = _track(collected.under(mapping))
    if len(track.time_s) < _FEWEST_POSES:
        raise BagError(f"{topic.name} has {len(track.time_s)} poses, too few")
    way_m = float(np.ptp(track.poses[:, :2], axis=0).max())
    if not way_m >= _SHORTEST_WAY_M:
        raise BagError(f"{topic.name} does not move, it stays within {way_m:.2f} m")
    grid_around(track.poses[:, :2], cell_size_m(track))
    return PoseCandidate(topic, _corrected(mapping, collected), track)


def _track(collected: MappedPoses) -> PoseTrack:
    times_s, poses = collected.rows()
    placed = np.isfinite(poses).all(axis=1)
    return PoseTrack(times_s[placed, 0], times_s[placed, 1], poses[placed])


def _corrected(mapping: BagMapping, collected: MappedPoses) -> BagMapping:
    """With the frame in which a localisation moves that of the poses, where /tf holds one: without
    it laps drift apart. Commands are compared with the poses as they are, which have no jumps."""
    frame = "" if collected.from_tf else collected.frame_that_corrects
    if not frame:
        return mapping
    corrected = mapping.model_copy(update={"frame": frame})
    try:
        track = _track(collected.under(corrected))
    except BagError:  # as where the localisation is of another clock
        return mapping
    return corrected if len(track.time_s) >= _FEWEST_POSES else mapping


def _speed_mps(track: PoseTrack) -> float:
    """The speed that the robot exceeds in a tenth of its motion."""
    time_s = np.arange(track.time_s[0], track.time_s[-1], 0.5)[:100_000]
    speeds_mps = np.hypot(*np.diff(track.at(time_s), axis=0).T) / 0.5
    moving = speeds_mps[speeds_mps > 0.01]
    return float(np.quantile(moving, 0.9)) if len(moving) else _USUAL_SPEED_MPS


def minimum_speed_mps(track: PoseTrack) -> float:
    return min(_USUAL_SPEED_MPS, round(_SLOW_SHARE * _speed_mps(track), 4))


def cell_size_m(track: PoseTrack) -> float:
    """Of a cell that the robot crosses in about a period."""
    way_m = _speed_mps(track) * PERIOD_S
    return min(_CELL_SIZES_M, key=lambda size_m: abs(np.log(size_m / way_m)))
