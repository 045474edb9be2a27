"""People of a bag in the frame of the grid, with velocities: recorded, or from the ways of ids."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import blake2b
from pathlib import Path

import numpy as np

from bags.messages.people import SeenPeople, SightedIds, people_in, require_people
from bags.reader import BagReader
from bags.topic import topic_named, topics_named
from serd_app.drives.table_drives import is_table
from serd_app.drives.transforms import Poses, RecordedTransforms, TransformTree


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
    return _with_velocities(_in_frame(sightings, tf.tree, frame.lstrip("/")))


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


def _with_velocities(sightings: list[Sighting]) -> list[Sighting]:
    """Where a type has no velocities, those from the places of the same id before."""
    ids = SightedIds()
    return [
        replace(each, people=ids.with_velocities(each.people, each.time_s)) for each in sightings
    ]
