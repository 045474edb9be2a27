"""People of standard message types, in the map and with velocities."""

from dataclasses import replace
from zlib import crc32

import numpy as np

from serd_bag.messages.people import SeenPeople, SightedIds
from serd_ros.convert.checks import require_finite
from serd_ros.convert.frames import Frames, plain_name
from serd_ros.convert.stamp import require_time
from serd_ros.endpoints import topics
from serd_sim.perception.people_tracker import PeopleTracker
from serd_sim.world.observation import People


class PeopleInMap:
    """Converts the people of one topic, message by message.

    A type without velocities gets those of its ids, 0 for an id that is new; without ids too, its
    people are tracked as those in scans are.
    """

    def __init__(self) -> None:
        self._ids, self._tracker, self._last_ns = SightedIds(), PeopleTracker(), 0

    def convert(self, seen: SeenPeople, frames: Frames) -> tuple[int, People]:
        """(stamp_ns, people in the map); MessageError for stamps, frames and numbers that are
        none."""
        time_ns = require_time(seen.header.stamp_ns)
        require_finite("positions", seen.position_m)
        # The types that have no velocities give NaN in all three coordinates.
        require_finite("velocities", seen.velocity_mps[~np.isnan(seen.velocity_mps).all(axis=1)])
        placed = _in_map(seen, frames)
        if time_ns < self._last_ns:
            self._tracker.reset()
        self._last_ns = time_ns
        without_velocities = np.isnan(placed.velocity_mps).any()
        # An empty message has no type of people by which to choose: tracks go on until they end.
        goes_on = not len(placed.position_m) and len(self._tracker.identity)
        if not any(placed.ids) and (without_velocities or goes_on):
            return time_ns, self._tracked(placed, time_ns * 1e-9)
        placed = self._ids.with_velocities(placed, time_ns * 1e-9)
        numbers = [crc32(name.encode()) if name else row for row, name in enumerate(placed.ids)]
        velocity_mps = np.nan_to_num(placed.velocity_mps[:, :2], nan=0.0)
        identity = np.array(numbers, dtype=np.int64)
        return time_ns, People(placed.position_m[:, :2], velocity_mps, identity)

    def _tracked(self, placed: SeenPeople, time_s: float) -> People:
        tracker = self._tracker
        tracker.update(placed.position_m[:, :2], time_s)
        return People(tracker.position_m, tracker.velocity_mps, tracker.identity)


def _in_map(seen: SeenPeople, frames: Frames) -> SeenPeople:
    if plain_name(seen.header.frame) == topics.MAP_FRAME:
        return seen
    # A camera's frame is not level; its people are placed in space.
    matrix = frames.place(seen.header.frame, topics.MAP_FRAME, level=False).matrix
    turn = matrix[:3, :3].T
    return replace(
        seen,
        position_m=seen.position_m @ turn + matrix[:3, 3],
        velocity_mps=seen.velocity_mps @ turn,
    )
