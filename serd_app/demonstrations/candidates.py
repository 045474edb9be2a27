"""The likeliest topics of a bag for poses and commands, with their messages.

They are recognised by type and name; whether they fit one another is tested in `suggest`.
"""

import re
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np

from serd_app.demonstrations.fitted_grid import cell_size_at_m, grid_around
from serd_app.drives.actions import MappedActions, PoseTrack
from serd_app.drives.drive import RecordedDrive, source_of
from serd_app.drives.mapped import MappedMessages, MappedPoses
from serd_app.drives.mapping import BagMapping
from serd_bag.errors import BagError
from serd_bag.reader import BagReader
from serd_bag.topic import RawMessage, Topic

_MOST = 6
_FEWEST_POSES = 10
_SHORTEST_WAY_M = 0.2
_USUAL_SPEED_MPS = 0.05
#: Of the speed of the fastest tenth of the motion, from which on a slower robot moves.
_SLOW_SHARE = 1 / 3
_Made = TypeVar("_Made")


class _Kind(NamedTuple):
    """Short names of types and words of names, the likeliest first, and words of other things."""

    types: tuple[str, ...]
    words: tuple[frozenset[str], ...]
    others: frozenset[str]


def _words(text: str) -> frozenset[str]:
    return frozenset(re.findall(r"[a-z]+", text.lower()))


_POSES = _Kind(
    (
        *("Odometry", "PoseWithCovarianceStamped", "PoseStamped", "Pose2D", "Pose2DStamped"),
        *("Pose", "PoseWithCovariance", "TransformStamped", "TFMessage", "tfMessage"),
    ),
    (_words("odom odometry"), _words("pose localization amcl base robot slam")),
    _words(
        "goal target waypoint waypoints plan path initialpose initial setpoint desired reference"
        " cmd command lookahead carrot clicked marker markers person people pedestrian human"
        " obstacle object camera static"
    ),
)
_COMMANDS = _Kind(
    ("Twist", "TwistStamped", "AckermannDriveStamped", "AckermannDrive"),
    (_words("cmd command"), _words("drive vel velocity twist teleop key")),
    _words(
        "odom odometry imu gps fix vicon mocap covariance measured actual estimated feedback state"
        " status"
    ),
)
_BODIES = ("base_link", "base_footprint", "base", "body", "robot", "base_frame")


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

    @property
    def minimum_speed_mps(self) -> float:
        """From which on the robot moves."""
        return min(_USUAL_SPEED_MPS, round(_SLOW_SHARE * _speed_mps(self.track), 4))

    @property
    def cell_size_m(self) -> float:
        """Side of a cell that the robot crosses in about a second."""
        return cell_size_at_m(_speed_mps(self.track))

    @property
    def alone(self) -> BagMapping:
        """The mapping of the poses with hidden actions."""
        values = {"action_from": "hidden", "minimum_speed_mps": self.minimum_speed_mps}
        return self.mapping.model_copy(update=values)


class Candidates:
    """Messages of the likeliest topics, collected in one pass over the bag.

    poses: those that move, the likeliest first. actions: by topic, those with messages. rejected:
    why topics were left out.
    """

    def __init__(self, reader: BagReader) -> None:
        self._source, self._known = source_of(reader.path), reader.topics
        self._damaged: dict[str, BagError] = {}
        self.rejected: list[str] = []
        poses = self._readers(
            _POSES, lambda name: MappedPoses(self._known, BagMapping(pose_topic=name), self._source)
        )
        actions = self._readers(_COMMANDS, self._action_reader)
        takers: dict[str, list[Callable[[RawMessage], None]]] = {}
        collected: list[MappedPoses | MappedActions] = [*poses.values(), *actions.values()]
        for each in collected:
            for name in each.topics:
                takers.setdefault(name, []).append(each.take)
        for message in reader.messages(takers.keys() & self._known.keys()):
            for take in takers[message.topic]:
                try:
                    take(message)
                except BagError as error:  # noqa: PERF203
                    self._damaged.setdefault(message.topic, error)
        self.actions = {name: each for name, each in actions.items() if each.has_messages}
        self._messages = poses
        made = (
            self._made(_pose_candidate, self._known[name], each) for name, each in poses.items()
        )
        self.poses = [candidate for candidate in made if candidate is not None]

    def drive(self, mapping: BagMapping) -> RecordedDrive:
        """What `serd demos` takes from the bag by one of these mappings; BagError where it cannot,
        as with a damaged message."""
        poses = self._messages[mapping.pose_topic]
        actions = self.actions[mapping.action_topic] if mapping.has_action_topic else None
        messages = MappedMessages(mapping, self._source, poses, actions)
        for name in sorted(self._damaged.keys() & messages.topics):
            raise self._damaged[name]
        return messages.drive()

    def _action_reader(self, name: str) -> MappedActions:
        mapping = BagMapping(action_from="velocity", action_topic=name)
        return MappedActions(mapping, self._known[name], self._source)

    def _readers(self, kind: _Kind, make: Callable[[str], _Made]) -> dict[str, _Made]:
        """By topic, of the likeliest ones."""
        names = _ranked(self._known.values(), kind)[:_MOST]
        made = {name: self._made(make, name) for name in names}
        return {name: reader for name, reader in made.items() if reader is not None}

    def _made(self, make: Callable[..., _Made], *arguments: object) -> _Made | None:
        """None, with the reason in `rejected`, where a rule of its kind is broken."""
        try:
            return make(*arguments)
        except BagError as error:
            self.rejected.append(str(error).removeprefix(f"{self._source}: "))
            return None


def _pose_candidate(topic: Topic, collected: MappedPoses) -> PoseCandidate:
    """BagError where it shows no motion of one robot."""
    mapping = BagMapping(pose_topic=topic.name)
    frames = _robot_frames(collected.tree.names)
    if collected.from_tf and frames:
        mapping = mapping.model_copy(update={"robot_frame": frames[0]})
    track = collected.track(mapping)
    if len(track.time_s) < _FEWEST_POSES:
        raise BagError(f"{topic.name} has {len(track.time_s)} poses, too few")
    way_m = float(np.ptp(track.poses[:, :2], axis=0).max())
    if not way_m >= _SHORTEST_WAY_M:
        raise BagError(f"{topic.name} does not move, it stays within {way_m:.2f} m")
    found = PoseCandidate(topic, _corrected(mapping, collected), track)
    grid_around(track.poses[:, :2], found.cell_size_m)
    return found


def _corrected(mapping: BagMapping, collected: MappedPoses) -> BagMapping:
    """With the frame in which a localisation moves that of the poses, where /tf holds one: without
    it laps drift apart. Commands are compared with the poses as they are, which have no jumps."""
    frame = "" if collected.from_tf else collected.frame_that_corrects
    if not frame:
        return mapping
    corrected = mapping.model_copy(update={"frame": frame})
    try:
        track = collected.track(corrected)
    except BagError:  # as where the localisation is of another clock
        return mapping
    return corrected if len(track.time_s) >= _FEWEST_POSES else mapping


def _speed_mps(track: PoseTrack) -> float:
    """The speed that the robot exceeds in a tenth of its motion."""
    time_s = np.arange(track.time_s[0], track.time_s[-1], 0.5)[:100_000]
    speeds_mps = np.hypot(*np.diff(track.at(time_s), axis=0).T) / 0.5
    moving = speeds_mps[speeds_mps > 0.01]
    return float(np.quantile(moving, 0.9)) if len(moving) else _USUAL_SPEED_MPS


def _robot_frames(frames: Collection[str]) -> list[str]:
    """Frames of a robot's body, in any namespace, the likeliest first."""
    ranks = {frame: frame.rsplit("/", 1)[-1] for frame in frames}
    usual = [frame for frame in frames if ranks[frame] in _BODIES]
    return sorted(usual, key=lambda frame: _BODIES.index(ranks[frame]))


def _ranked(topics: Iterable[Topic], kind: _Kind) -> list[str]:
    """Names of topics of a kind: by their words, types and names."""
    ranks = []
    for topic in topics:
        short, words = topic.type_name.rsplit("/", 1)[-1], _words(topic.name)
        if short in kind.types and not words & kind.others:
            named = (place for place, known in enumerate(kind.words) if words & known)
            place = next(named, len(kind.words))
            ranks.append((place, kind.types.index(short), len(topic.name), topic.name))
    return [name for *_, name in sorted(ranks)]
