"""People of a bag in the frame of the grid, with velocities: recorded, or from the ways of ids.

Tracks are by ids; without ids, people of two messages in a row are the same where they are nearest
to where they would be at the velocity of the first: the assignment of least total distance, up to
`_FARTHEST_M`.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import blake2b
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from serd_app.drives.table_drives import Crowd, is_table
from serd_app.drives.transforms import Poses, RecordedTransforms, TransformTree
from serd_app.errors import AppError
from serd_bag.messages.people import SeenPeople, SightedIds, people_in, require_people
from serd_bag.reader import BagReader
from serd_bag.topic import topic_named, topics_named
from serd_core.arrays import BoolArray, FloatArray
from serd_files.trajectories.read import Track

#: Between two messages: a person who is not seen for longer, or jumps farther, is another one.
_LONGEST_S, _FARTHEST_M = 1.0, 0.5


@dataclass(frozen=True, eq=False)
class Sighting:
    """People at a time; digest: of the message and its time."""

    time_s: float
    people: SeenPeople
    digest: bytes


def sightings_of_all(
    recordings: Sequence[Path], topic: str, *, frame: str = "", tolerant: bool = False
) -> list[list[Sighting]]:
    """Of each recording; none of a table, or of a bag without the topic.

    tolerant: use what broken bags still hold.
    """
    found = list[list[Sighting]]()
    for each in recordings:
        reader = None if is_table(each) else BagReader(each, tolerant=tolerant)
        named = reader is not None and topics_named(reader.topics, topic)
        found.append(recorded_sightings(reader, topic, frame=frame) if reader and named else [])
    return found


def recorded_sightings(reader: BagReader, topic: str, *, frame: str = "") -> list[Sighting]:
    """Each message once.

    Numbers are NaN where /tf does not reach or no velocity is known. frame: into which people in
    another one are brought by /tf; empty: as they are.
    """
    name = topic_named(reader.topics, topic)
    known = reader.topics[name]
    require_people(known, f"bag {reader.path}")
    tf, sightings = RecordedTransforms(reader.topics if frame else {}), []
    seen = set[bytes]()
    for message in reader.messages({name, *tf.topics}):
        if tf.take(message):
            continue
        time = message.log_time_ns.to_bytes(8, "little", signed=True)
        digest = blake2b(message.data + time, digest_size=16).digest()
        if digest not in seen:
            seen.add(digest)
            people = people_in(message.data, known)
            stamp_ns = people.header.stamp_ns or message.log_time_ns
            sightings.append(Sighting(stamp_ns / 1e9, people, digest))
    ids = SightedIds()
    return [
        replace(each, people=ids.with_velocities(each.people, each.time_s))
        for each in _in_frame(sightings, tf, frame.lstrip("/"))
    ]


def _in_frame(sightings: list[Sighting], tree: TransformTree, frame: str) -> list[Sighting]:
    """All of them in one frame; BagError where no chain of /tf joins them."""
    placed = list(sightings)
    frames = [each.people.header.frame.lstrip("/") for each in sightings]
    for own in {each for each in frames if frame and each not in ("", frame)}:
        rows = [row for row, each in enumerate(frames) if each == own]
        times_s = np.array([sightings[row].time_s for row in rows])
        origins = Poses.of_numbers(np.zeros((len(rows), 3)))
        at = tree.into(frame, own, origins, times_s)
        for number, row in enumerate(rows):
            people, one = sightings[row].people, at.select(np.array([number]))
            moved = replace(
                people,
                position_m=one.position_m + one.rotation.apply(people.position_m),
                velocity_mps=one.rotation.apply(people.velocity_mps),
            )
            placed[row] = replace(sightings[row], people=moved)
    return placed


def crowd_of_sightings(sightings: Sequence[Sighting], source: str) -> Crowd:
    """All people as experts; AppError where no person is seen twice."""
    tracks = tracks_of_sightings(sightings)
    if not tracks:
        raise AppError(
            f"bag {source} must hold people who are seen twice at least to be experts, got none in"
            f" {len(sightings)} messages; name their topic as people_topic"
        )
    return Crowd(tracks, tuple(range(len(tracks))))


def tracks_of_sightings(sightings: Sequence[Sighting]) -> tuple[Track, ...]:
    """Of all who are seen in two messages at least, in the order of their first one."""
    rows = defaultdict[str, list[tuple[float, float, float]]](list)
    linker, last_s = _Linker(), -np.inf
    for one in sorted(sightings, key=lambda each: each.time_s):
        if one.time_s <= last_s:
            continue
        last_s, people = one.time_s, one.people
        seen = np.isfinite(people.position_m[:, :2]).all(axis=1)
        names = np.array(people.ids, dtype=object)
        unnamed = seen & (names == "")
        names[unnamed] = linker.names_of(
            one.time_s, people.position_m[unnamed, :2], people.velocity_mps[unnamed, :2]
        )
        for name, place in zip(names[seen], people.position_m[seen, :2].tolist(), strict=True):
            rows[name].append((one.time_s, *place))
    tables = {name: np.array(each) for name, each in rows.items() if len(each) > 1}
    return tuple(Track(name, table[:, 0], table[:, 1:]) for name, table in tables.items())


class _Linker:
    """Names people without ids by whom they follow on."""

    def __init__(self) -> None:
        self._time_s = np.zeros(0)
        self._place_m = self._velocity_mps = np.zeros((0, 2))
        self._names = list[str]()
        self._count = 0

    def names_of(self, time_s: float, place_m: FloatArray, velocity_mps: FloatArray) -> list[str]:
        """Of people (N, 2) at a time; velocity_mps: NaN counts as at rest."""
        names = [""] * len(place_m)
        step_s = time_s - self._time_s
        expected = self._place_m + step_s[:, None] * self._velocity_mps
        far = np.linalg.norm(expected[:, None] - place_m, axis=2)
        left = step_s <= _LONGEST_S
        cost = np.where(left[:, None], np.minimum(far, 2 * _FARTHEST_M), 2 * _FARTHEST_M)
        before, now = linear_sum_assignment(cost)
        for old, new in zip(before.tolist(), now.tolist(), strict=True):
            if left[old] and far[old, new] <= _FARTHEST_M:
                names[new], left[old] = self._names[old], False
        for row, name in enumerate(names):
            if not name:
                self._count += 1
                names[row] = f"person {self._count}"
        self._keep(left)
        self._time_s = np.append(self._time_s, np.full(len(names), time_s))
        self._names = self._names + names
        self._place_m = np.concatenate([self._place_m, place_m])
        self._velocity_mps = np.concatenate([self._velocity_mps, np.nan_to_num(velocity_mps)])
        return names

    def _keep(self, rows: BoolArray) -> None:
        """Those who may be seen again."""
        self._names = [name for name, kept in zip(self._names, rows, strict=True) if kept]
        self._time_s, self._place_m = self._time_s[rows], self._place_m[rows]
        self._velocity_mps = self._velocity_mps[rows]
