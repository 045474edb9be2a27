"""People of a bag in the frame of the grid, with velocities: recorded, or from the ways of ids."""

from dataclasses import dataclass, replace
from hashlib import blake2b

import numpy as np

from bags.messages.people import SeenPeople, SightedIds, people_in, require_people
from bags.reader import BagReader
from bags.topic import topic_named
from serd_app.drives.transforms import Poses, RecordedTransforms, TransformTree
from serd_core.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Sighting:
    """People at a time."""

    time_s: float
    people: SeenPeople


def recorded_people(
    reader: BagReader, topic: str, seen: set[bytes], *, frame: str = ""
) -> tuple[FloatArray, FloatArray]:
    """(N, 2) positions and velocities of all sightings; see `recorded_sightings`."""
    placed = recorded_sightings(reader, topic, seen, frame=frame)
    nothing = [np.zeros((0, 2))]
    return (
        np.concatenate(nothing + [each.people.position_m[:, :2] for each in placed]),
        np.concatenate(nothing + [each.people.velocity_mps[:, :2] for each in placed]),
    )


def recorded_sightings(
    reader: BagReader, topic: str, seen: set[bytes], *, frame: str = ""
) -> list[Sighting]:
    """The messages whose digests are not among those seen, to which theirs are added.

    Numbers are NaN where /tf does not reach or no velocity is known. frame: into which people in
    another one are brought by /tf; empty: as they are.
    """
    name = topic_named(reader.topics, topic)
    known = reader.topics[name]
    require_people(known, f"bag {reader.path}")
    tf, sightings = RecordedTransforms(reader.topics if frame else {}), []
    for message in reader.messages({name, *tf.topics}):
        if tf.take(message):
            continue
        time = message.log_time_ns.to_bytes(8, "little", signed=True)
        digest = blake2b(message.data + time, digest_size=16).digest()
        if digest not in seen:
            seen.add(digest)
            people = people_in(message.data, known)
            stamp_ns = people.header.stamp_ns or message.log_time_ns
            sightings.append(Sighting(stamp_ns / 1e9, people))
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
