"""The likeliest topics of a bag for poses and commands, with their messages.

They are recognised by type and name; whether they fit one another is tested in `command_fit`.
"""

import re
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TypeVar

import numpy as np

from serd_app.demonstrations.grid.fitted_grid import cell_size_at_m, grid_around
from serd_app.drives.episode_spans import EPISODE
from serd_app.drives.mapped.actions import MappedActions, PoseTrack
from serd_app.drives.mapped.drive import MappedMessages, mapped_messages
from serd_app.drives.mapped.mapping import BagMapping
from serd_app.drives.mapped.poses import MappedPoses
from serd_app.drives.recorded_drive import INTENT, POSE, RecordedDrive, source_of
from serd_bag.errors import BagError
from serd_bag.reader import BagReader
from serd_bag.topic import RawMessage, Topic, topics_named

_MOST = 6
_FEWEST_POSES = 10
_SHORTEST_WAY_M = 0.2
_USUAL_SPEED_MPS = 0.05
#: Of the speed of the fastest tenth of the motion, from which on a slower robot moves.
_SLOW_SHARE = 1 / 3
_Made = TypeVar("_Made")
#: Short names of types, the likeliest first.
_POSE_TYPES = (
    *("Odometry", "PoseWithCovarianceStamped", "PoseStamped", "Pose2D", "Pose2DStamped", "Pose"),
    *("PoseWithCovariance", "TransformStamped", "TFMessage", "tfMessage"),
)
_VELOCITY_TYPES = ("Twist", "TwistStamped", "AckermannDriveStamped", "AckermannDrive")
_NO_POSE = frozenset(
    (
        *("goal", "target", "waypoint", "waypoints", "plan", "path", "initialpose", "initial"),
        *("setpoint", "desired", "reference", "cmd", "command", "lookahead", "carrot", "clicked"),
        *("marker", "markers", "person", "people", "pedestrian", "human", "obstacle", "object"),
        *("camera", "static"),
    )
)
_NO_COMMAND = frozenset(
    (
        *("odom", "odometry", "imu", "gps", "fix", "vicon", "mocap", "covariance"),
        *("measured", "actual", "estimated", "feedback", "state", "status"),
    )
)
_POSE_WORDS = (("odom", "odometry"), ("pose", "localization", "amcl", "base", "robot", "slam"))
_COMMAND_WORDS = (("cmd", "command"), ("drive", "vel", "velocity", "twist", "teleop", "key"))


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

    def drive(self, mapping: BagMapping) -> RecordedDrive:
        """What `serd demos` takes from the bag by one of these mappings; BagError where it cannot,
        as with a damaged message."""
        messages = self.own if self.own and mapping == self.own.mapping else self._mapped(mapping)
        for name in sorted(self._damaged.keys() & messages.topics):
            raise self._damaged[name]
        return messages.drive()

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
    """Of a cell that the robot crosses in about a second."""
    return cell_size_at_m(_speed_mps(track))


def pose_candidates(topics: Iterable[Topic]) -> list[Topic]:
    """Those of a type with a pose, whose names do not name a goal or another thing."""
    return _ranked(topics, _POSE_TYPES, _POSE_WORDS, _NO_POSE)


def command_candidates(topics: Iterable[Topic]) -> list[Topic]:
    """Those of a type with a velocity, whose names do not name a measurement."""
    return _ranked(topics, _VELOCITY_TYPES, _COMMAND_WORDS, _NO_COMMAND)


def in_one_namespace(first: str, second: str) -> bool:
    """Whether two topics may be of one robot: the namespace of one begins with the other's."""
    one, other = (str(PurePosixPath(name).parent).rstrip("/") + "/" for name in (first, second))
    return one.startswith(other) or other.startswith(one)


def robot_frames(frames: Collection[str]) -> list[str]:
    """Frames of a robot's body, in any namespace, the likeliest first."""
    usual = ("base_link", "base_footprint", "base", "body", "robot", "base_frame")
    short = {frame: frame.rsplit("/", 1)[-1] for frame in frames}
    return sorted(
        (each for each in frames if short[each] in usual), key=lambda e: usual.index(short[e])
    )


def _ranked(
    topics: Iterable[Topic],
    types: tuple[str, ...],
    words: tuple[tuple[str, ...], ...],
    others: frozenset[str],
) -> list[Topic]:
    """Topics of these types without a word of others: by their words, types and names."""

    def rank(topic: Topic) -> tuple[int, int, int, str]:
        found = _words(topic.name)
        named = next((place for place, each in enumerate(words) if found & set(each)), len(words))
        return named, types.index(_short(topic)), len(topic.name), topic.name

    found = [each for each in topics if _short(each) in types and not _words(each.name) & others]
    return sorted(found, key=rank)


def _short(topic: Topic) -> str:
    return topic.type_name.rsplit("/", 1)[-1]


def _words(name: str) -> set[str]:
    return set(re.findall(r"[a-z]+", name.lower()))


def mapping_of_poses(bag: Path) -> BagMapping | None:
    """By the likeliest pose of a bag without commands and intents; None for any other bag."""
    reader = BagReader(bag, tolerant=True)
    if topics_named(reader.topics, INTENT):
        return None
    collected = Candidates(reader)
    poses = collected.poses()
    if collected.actions or not poses:
        return None
    marks = EPISODE if len(topics_named(reader.topics, EPISODE)) == 1 else ""
    return poses_alone(poses[0]).model_copy(update={"episode_topic": marks})


def poses_alone(pose: PoseCandidate) -> BagMapping:
    """The mapping of a pose whose actions are hidden."""
    values = {"action_from": "hidden", "minimum_speed_mps": minimum_speed_mps(pose.track)}
    return pose.mapping.model_copy(update=values)
