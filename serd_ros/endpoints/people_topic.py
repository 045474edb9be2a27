"""People of a topic in the map, of whichever known type its publishers have at run time.

The middleware has one type per topic and process: until a publisher of another known type comes,
the topic is received as `pedestrians`, a PointCloud2. Other types are received as bytes, so that
their packages need not be installed.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from zlib import crc32

import numpy as np
from sensor_msgs.msg import PointCloud2

from serd_app.drives.frame_graph import plain_name
from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import MessageType, message_type
from serd_bag.messages.people import CLOUD, SeenPeople, SightedIds, people_in, require_people
from serd_bag.topic import Topic
from serd_ros.convert.frames import Frames
from serd_ros.convert.sensors import from_people_message
from serd_ros.convert.stamp import require_finite, require_time
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.endpoints import Endpoints
from serd_ros.endpoints.followed_topic import FollowedTopic, Received
from serd_ros.endpoints.topic_types import TopicType
from serd_ros.errors import MessageError
from serd_sim.perception.scan_people import PeopleTracker
from serd_sim.world.observation import People

_LOOK_PERIOD_S, _LOG_PERIOD_S = 0.5, 5.0
_HASH = "RIHS01_"


class PeopleInMap:
    """Converts the people of one topic, message by message.

    A type without velocities gets those of its ids, 0 for an id that is new; without ids too, its
    people are tracked as those in scans are.
    """

    def __init__(self) -> None:
        self._ids, self._tracker, self._last_ns = SightedIds(), PeopleTracker(), 0

    def convert(self, seen: SeenPeople, frames: Frames) -> tuple[int, People]:
        """(stamp_ns, people in the map); MessageError for a stamp, frame or number that is none."""
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
            tracker = self._tracker
            tracker.update(placed.position_m[:, :2], time_ns * 1e-9)
            return time_ns, People(tracker.position_m, tracker.velocity_mps, tracker.identity)
        placed = self._ids.with_velocities(placed, time_ns * 1e-9)
        numbers = [crc32(name.encode()) if name else row for row, name in enumerate(placed.ids)]
        velocity_mps = np.nan_to_num(placed.velocity_mps[:, :2], nan=0.0)
        identity = np.array(numbers, dtype=np.int64)
        return time_ns, People(placed.position_m[:, :2], velocity_mps, identity)


def _in_map(seen: SeenPeople, frames: Frames) -> SeenPeople:
    if plain_name(seen.header.frame) == topics.MAP_FRAME:
        return seen
    # A camera's frame is not level; its people are placed in space.
    matrix = frames.place(seen.header.frame, topics.MAP_FRAME, level=False).matrix
    turn = matrix[:3, :3].T
    position_m, velocity_mps = seen.position_m @ turn + matrix[:3, 3], seen.velocity_mps @ turn
    return replace(seen, position_m=position_m, velocity_mps=velocity_mps)


class PeopleTopic:
    """Calls back with (stamp_ns, people in the map) of each message.

    name: of the topic; fault: why messages cannot be read although it has publishers, else empty.
    """

    def __init__(
        self, endpoints: Endpoints, name: str, take: Callable[[int, People], None]
    ) -> None:
        self.fault = ""
        self._node, self._endpoints = endpoints.node, endpoints
        self.name, self._take_people = name, take
        #: Of the present type.
        self._subscribed: Endpoints | None = None
        self._followed: FollowedTopic | None = None
        self._topic, self._people = Topic(name, MessageType(CLOUD, "", "")), PeopleInMap()
        self._subscribe()
        endpoints.every(_LOOK_PERIOD_S, self._look)

    def _on_cloud(self, message: PointCloud2) -> None:
        self._take_people(*from_people_message(message, self._node.frames))

    def _on_message(self, message: Received) -> None:
        try:
            seen = people_in(message.data, self._topic)
        except BagError as error:
            raise MessageError("message must hold people", error, "correct it") from None
        self._take_people(*self._people.convert(seen, self._node.frames))

    def _look(self) -> None:
        """Follow the type of the publishers; while they have several, the present one stays.

        It subscribes at the look after the one that finds another type: the executor keeps the
        subscription of the type before until then.
        """
        if self._subscribed is None:
            self._subscribe()
        found = self._node.get_publishers_info_by_topic(self.name)
        hashes = {each.topic_type: str(each.topic_type_hash) for each in found}
        self.fault = ""
        if hashes and self._topic.type_name not in hashes:
            self._change_type(hashes)
        if self._followed is not None:
            self._followed.look()

    def _change_type(self, hashes: Mapping[str, str]) -> None:
        """Take the first type that can be read; `fault` names why there is none."""
        found = [self._readable(*each) for each in sorted(hashes.items())]
        topic = next((each for each in found if isinstance(each, Topic)), None)
        if topic is None:
            self.fault = "; ".join(map(str, found))
            self._node.get_logger().warning(self.fault, throttle_duration_sec=_LOG_PERIOD_S)
            return
        self._topic, self._people = topic, PeopleInMap()
        if self._subscribed is not None:
            self._endpoints.destroy(self._subscribed)
        self._subscribed = self._followed = None

    def _readable(self, type_name: str, type_hash: str) -> Topic | BagError:
        """The topic of the type, or why it cannot be read: its publishers may have another one."""
        try:
            topic = Topic(self.name, message_type(type_name))
            require_people(topic, self._node.get_name())
            known = topic.message_type.type_hash
            if type_hash.startswith(_HASH) and known and type_hash != known:
                package = type_name.partition("/")[0]
                raise BagError(
                    f"{topic.name}: {type_name} must be as installed here, {known}, its publishers"
                    f" have {type_hash}; install their version of {package} here"
                )
        except BagError as error:
            return error
        return topic

    def _subscribe(self) -> None:
        name, kind = self._node.resolve_topic_name(self.name), self._topic.type_name
        self._subscribed = scope = self._endpoints.scope()
        if kind == CLOUD:
            scope.subscribe(PointCloud2, self.name, self._on_cloud, qos.STATE)
        else:
            take = self._on_message
            self._followed = FollowedTopic(scope, name, TopicType(kind), take, self.name)
            self._node.get_logger().info(f"{name}: people are received as {kind}")
