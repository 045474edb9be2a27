"""People of a bag in the frame of the grid, with velocities: recorded, or from the ways of ids.

Tracks are by ids; without ids, people of two messages in a row are the same where they are nearest
to where they would be at the velocity of the first: the assignment of least total distance, up to
`_FARTHEST_M`.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import blake2b
from itertools import compress, count
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from serd_app.drives.frame_graph import plain_name
from serd_app.drives.table_drives import Crowd, is_table
from serd_app.drives.transforms import RecordedTransforms
from serd_app.errors import AppError
from serd_bag.messages.people import SeenPeople, SightedIds, people_in, require_people
from serd_bag.reader import BagReader
from serd_bag.topic import topic_named, topics_named
from serd_core.arrays import FloatArray
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
    tf, sightings = RecordedTransforms(reader.topics if frame else {}), dict[bytes, Sighting]()
    for message in reader.messages({name, *tf.topics}):
        if tf.take(message):
            continue
        time = message.log_time_ns.to_bytes(8, "little", signed=True)
        digest = blake2b(message.data + time, digest_size=16).digest()
        if digest not in sightings:
            people = people_in(message.data, known)
            stamp_ns = people.header.stamp_ns or message.log_time_ns
            sightings[digest] = Sighting(stamp_ns / 1e9, people, digest)
    ids, placed = SightedIds(), _in_frame(list(sightings.values()), tf, plain_name(frame))
    return [replace(one, people=ids.with_velocities(one.people, one.time_s)) for one in placed]


def _in_frame(sightings: list[Sighting], tf: RecordedTransforms, frame: str) -> list[Sighting]:
    """All of them in one frame; BagError where no chain of /tf joins them."""
    placed = list(sightings)
    frames = [plain_name(one.people.header.frame) for one in sightings]
    for own in {*frames} - {"", frame} if frame else ():
        rows = [row for row, name in enumerate(frames) if name == own]
        times_s = np.array([sightings[row].time_s for row in rows])
        for row, matrix in zip(rows, tf.placements(frame, own, times_s), strict=True):
            people, turn = sightings[row].people, matrix[:3, :3].T
            moved = replace(
                people,
                position_m=people.position_m @ turn + matrix[:3, 3],
                velocity_mps=people.velocity_mps @ turn,
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
        #: Of those who may be seen again: time, place and velocity.
        self._rows = np.zeros((0, 5))
        self._names, self._numbers = list[str](), count(1)

    def names_of(self, time_s: float, place_m: FloatArray, velocity_mps: FloatArray) -> list[str]:
        """Of people (N, 2) at a time; velocity_mps: NaN counts as at rest."""
        names = [""] * len(place_m)
        step_s = time_s - self._rows[:, 0]
        expected = self._rows[:, 1:3] + step_s[:, None] * self._rows[:, 3:]
        far = np.linalg.norm(expected[:, None] - place_m, axis=2)
        left = step_s <= _LONGEST_S
        cost = np.where(left[:, None], np.minimum(far, 2 * _FARTHEST_M), 2 * _FARTHEST_M)
        for old, new in zip(*map(np.ndarray.tolist, linear_sum_assignment(cost)), strict=True):
            if left[old] and far[old, new] <= _FARTHEST_M:
                names[new], left[old] = self._names[old], False
        names = [name or f"person {next(self._numbers)}" for name in names]
        now_s = np.full(len(names), time_s)
        here = np.column_stack([now_s, place_m, np.nan_to_num(velocity_mps)])
        self._rows = np.concatenate([self._rows[left], here])
        self._names = [*compress(self._names, left), *names]
        return names
