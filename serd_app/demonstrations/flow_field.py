"""In which direction people walk in each cell, from people whom bags and tables hold.

The flow of a cell is the axis nearest to the sum of the velocities seen in it; there is none where
fewer than a number of people were seen, or where they do not walk in one direction: the order
|sum v| / sum |v| is 1 when all walk the same way and 0 when they cancel.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import blake2b

import numpy as np

from serd_app.demonstrations.decision_table import FlowField
from serd_app.drives.drive import places_at
from serd_app.drives.people import SeenPeople, SightedIds, people_in, require_people
from serd_app.drives.recording import Recording
from serd_app.drives.transforms import RecordedTransforms, plain_name
from serd_bag.reader import BagReader
from serd_bag.topic import topic_named, topics_named
from serd_core.arrays import FloatArray
from serd_core.grid.grid import Grid, action_of_direction
from serd_core.grid.navigation import NO_FLOW
from serd_files.trajectories.read import Track

_LEAST_ORDER = 0.5
#: Velocities of people of a table are central differences over about this time.
_VELOCITY_S = 0.4


def flow_of_people(
    grid: Grid, position_m: FloatArray, velocity_mps: FloatArray, minimum_count: int = 20
) -> FlowField:
    """The flow of people at (N, 2) with velocities (N, 2); those off the grid or not finite are
    left.

    minimum_count: sightings below which a cell has none.
    """
    state = grid.states_at(position_m)
    seen = (state >= 0) & np.isfinite(velocity_mps).all(axis=1)
    state, velocity_mps = state[seen], velocity_mps[seen]
    sum_mps, speed_mps = np.zeros((grid.n_states, 2)), np.zeros(grid.n_states)
    np.add.at(sum_mps, state, velocity_mps)
    np.add.at(speed_mps, state, np.hypot(*velocity_mps.T))
    count = np.bincount(state, minlength=grid.n_states)
    length = np.hypot(*sum_mps.T)
    order = np.divide(length, speed_mps, out=np.zeros_like(length), where=length > 0)
    flow = np.full(grid.n_states, NO_FLOW, dtype=np.int64)
    known = (count >= minimum_count) & (order >= _LEAST_ORDER) & (length > 0)
    for row in np.flatnonzero(known):
        flow[row] = action_of_direction(*(sum_mps[row] / length[row]))
    return FlowField(flow, sum_mps / np.maximum(count, 1)[:, None], order, count)


@dataclass(frozen=True, eq=False)
class Sighting:
    """People at a time; digest: of the message and its time."""

    time_s: float
    people: SeenPeople
    digest: bytes


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


def flow_from_recordings(
    recordings: Sequence[Recording],
    grid: Grid,
    topic: str,
    *,
    frame: str = "",
    tolerant: bool = False,
) -> FlowField | None:
    """The flow of the people seen in all bags, and of the agents of all tables; None where there
    are none.

    A cloud or table that several of them hold counts once. topic, frame: of people in bags.
    tolerant: use what broken bags still hold.
    """
    seen: dict[bytes, tuple[FloatArray, FloatArray]] = {}
    for each in recordings:
        if each.people:
            position_m = np.concatenate([track.position_m for track in each.people])
            velocity_mps = np.concatenate([_velocity_mps(track) for track in each.people])
            digest = blake2b(position_m.tobytes(), digest_size=16).digest()
            seen.setdefault(digest, (position_m, velocity_mps))
        reader = None if each.of_table else BagReader(each.bag, tolerant=tolerant)
        if reader is not None and topics_named(reader.topics, topic):
            for one in recorded_sightings(reader, topic, frame=frame):
                people = one.people.position_m[:, :2], one.people.velocity_mps[:, :2]
                seen.setdefault(one.digest, people)
    if not seen:
        return None
    position_m, velocity_mps = map(np.concatenate, zip(*seen.values(), strict=True))
    return flow_of_people(grid, position_m, velocity_mps)


def _velocity_mps(track: Track) -> FloatArray:
    """(T, 2)."""
    early_s = np.maximum(track.time_s - _VELOCITY_S / 2, track.time_s[0])
    late_s = np.minimum(track.time_s + _VELOCITY_S / 2, track.time_s[-1])
    early_m, late_m = (
        places_at(at_s, track.time_s, track.position_m) for at_s in (early_s, late_s)
    )
    return np.asarray((late_m - early_m) / (late_s - early_s)[:, None])
