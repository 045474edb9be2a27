"""People in messages of standard types: ids, positions and velocities in the frame of the message.

| type | recognised by | ids | velocity |
| --- | --- | --- | --- |
| sensor_msgs/PointCloud2 | its name | none | fields vx, vy |
| people_msgs/People | `people` | name | velocity |
| spencer_tracking_msgs/TrackedPersons, also of pedsim_msgs | `tracks` | track_id | twist |
| vision_msgs/Detection3DArray | `detections` | id or tracking_id | none |

Messages may be decoded by rosbags or received by rclpy. Of detections with a class those of people
are taken.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import store_of
from serd_bag.messages.clocks import FloatArray
from serd_bag.messages.plain import Header, decode, header_of, points_of
from serd_bag.topic import Topic

CLOUD = "sensor_msgs/msg/PointCloud2"
#: Classes of a detection that are people; detectors trained on COCO name them 0.
_PERSON_CLASSES = frozenset({"person", "people", "pedestrian", "human", "0"})
_LISTS = ("people", "tracks", "detections")
#: Between two sightings of an id from which a velocity is taken: at most, and preferably.
_LONGEST_STEP_S, _STEP_S = 1.0, 0.5


@dataclass(frozen=True, eq=False)
class SeenPeople:
    """N people of one message; ids: (N,), empty texts where there are none; position_m,
    velocity_mps: (N, 3), the latter NaN where the type has none."""

    header: Header
    ids: tuple[str, ...]
    position_m: FloatArray
    velocity_mps: FloatArray


def people_of(message: Any) -> SeenPeople:
    """The people in a message of one of the types; BagError for another one."""
    if hasattr(message, "point_step"):
        fields = points_of(message, ("x", "y", "vx", "vy"))
        level = np.zeros_like(fields["x"])
        position_m, velocity_mps = (
            np.stack([fields[x], fields[y], level], axis=1) for x, y in (("x", "y"), ("vx", "vy"))
        )
        return SeenPeople(header_of(message.header), ("",) * len(level), position_m, velocity_mps)
    try:
        rows = _rows(message)
        return SeenPeople(
            header_of(message.header),
            tuple(name for name, _, _ in rows),
            _vectors(place for _, place, _ in rows),
            _vectors(velocity for _, _, velocity in rows),
        )
    except (AttributeError, TypeError) as error:  # another type with a list of such a name
        raise BagError(
            f"people must have the fields of a known type, got {type(message).__name__} ({error});"
            " name the topic of people in the mapping"
        ) from None


class SightedIds:
    """The last places of each id, which give velocities where a type has none."""

    def __init__(self) -> None:
        self._places: dict[str, deque[tuple[float, FloatArray]]] = {}

    def with_velocities(self, people: SeenPeople, time_s: float) -> SeenPeople:
        """The people seen at a time, in a frame at rest; NaN for an id that is new or empty.

        A velocity is that since the first sighting of the last 0.5 s, or the last one of the last
        second.
        """
        velocity_mps = people.velocity_mps.copy()
        for row in np.flatnonzero(np.isnan(velocity_mps).any(axis=1)):
            if people.ids[row]:
                velocity_mps[row] = self._velocity(people.ids[row], people.position_m[row], time_s)
        self._places = {
            name: places
            for name, places in self._places.items()
            if time_s - places[-1][0] <= _LONGEST_STEP_S
        }
        return replace(people, velocity_mps=velocity_mps)

    def _velocity(self, name: str, place_m: FloatArray, time_s: float) -> FloatArray:
        places = self._places.setdefault(name, deque())
        if places and time_s < places[-1][0]:
            places.clear()
        while len(places) > 1 and time_s - places[0][0] > _STEP_S:
            places.popleft()
        if not places or time_s > places[-1][0]:
            places.append((time_s, place_m))
        before = places[0]
        if not 0.0 < time_s - before[0] <= _LONGEST_STEP_S:
            return np.full(3, np.nan)
        return np.asarray((place_m - before[1]) / (time_s - before[0]))


def people_in(data: bytes, topic: Topic) -> SeenPeople:
    """The people in the bytes of a message, by the definition of its topic."""
    return people_of(decode(data, topic.type_name, store_of(topic)))


def require_people(topic: Topic, source: str) -> None:
    """BagError where messages of the topic are of none of the types."""
    if topic.type_name == CLOUD:
        return
    fields = dict(store_of(topic).fielddefs[topic.type_name][1])
    if not fields.keys() & set(_LISTS):
        raise BagError(
            f"{source}: people on {topic.name} must be of type {CLOUD}, people_msgs/msg/People,"
            " spencer_tracking_msgs/msg/TrackedPersons or vision_msgs/msg/Detection3DArray, got"
            f" {topic.type_name}; name the topic of people as people_topic"
        )


def _rows(message: Any) -> list[tuple[str, Any, Any]]:
    """(id, position, velocity or None) of each."""
    if hasattr(message, "people"):
        return [(each.name, each.position, each.velocity) for each in message.people]
    if hasattr(message, "tracks"):
        return [
            (str(each.track_id), each.pose.pose.position, each.twist.twist.linear)
            for each in message.tracks
        ]
    if hasattr(message, "detections"):
        return [  # with their id; before vision_msgs 4 the tracking_id, or none
            (
                str(getattr(each, "id", getattr(each, "tracking_id", ""))),
                each.bbox.center.position,
                None,
            )
            for each in message.detections
            if _is_person(each.results)
        ]
    raise BagError(
        f"people must be a PointCloud2 or a message with {', '.join(_LISTS)}, got"
        f" {type(message).__name__}; name the topic of people in the mapping"
    )


def _is_person(results: Sequence[Any]) -> bool:
    """Whether the likeliest class is that of people, or there is none."""
    if not len(results):
        return True
    # Before vision_msgs 4 a result has no hypothesis, but id and score itself.
    hypotheses = [getattr(each, "hypothesis", each) for each in results]
    likeliest = max(hypotheses, key=lambda each: each.score)
    name = likeliest.class_id if hasattr(likeliest, "class_id") else likeliest.id
    return str(name).lower() in _PERSON_CLASSES


def _vectors(rows: Iterable[Any]) -> FloatArray:
    found = [(np.nan,) * 3 if each is None else (each.x, each.y, each.z) for each in rows]
    return np.array(found, dtype=np.float64).reshape(-1, 3)
