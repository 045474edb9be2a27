"""Where the stamps of a message are, and who set them, by the definition of its type.

A stamp is that of a std_msgs/Header anywhere in the message. Its sender is the child frame of what
has the header, as of a transform, else the frame of the header. Other fields are passed over: in
CDR each is aligned to its size, in ROS 1 none is.
"""

import struct
from typing import Any, NamedTuple

from rosbags.interfaces import Nodetype
from rosbags.serde.utils import SIZEMAP
from rosbags.typesys.msg import normalize_msgtype

from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import store_of
from serd_bag.messages.plain import CDR_HEAD
from serd_bag.topic import CDR, ROS1, Topic

_SECOND_NS = 1_000_000_000
_HEADER = (Nodetype.NAME, "std_msgs/msg/Header")
_CHILD = "child_frame_id"
#: Of a type without fields; messages of ROS 1 do not have it.
_NO_FIELD = "structure_needs_at_least_one_member"
#: Messages within one that has no bytes; more are no more than its bytes.
_MOST_EMPTY = 1_000


class Stamp(NamedTuple):
    """A stamp in a message; place: its first byte of eight; time_ns: 0 where it is not set."""

    place: int
    time_ns: int
    sender: str


class StampFinder:
    """Finds the stamps in the messages of one topic, in CDR or of ROS 1.

        for place, time_ns, sender in StampFinder(reader.topics["/tf"])(message.data):
            ...

    inner: also those of headers inside of what has a header, as the poses of a path. It finds none
    where the definition of the type cannot be read.
    """

    def __init__(self, topic: Topic, *, inner: bool = False) -> None:
        self._is_ros1, self._inner = topic.encoding == ROS1, inner
        self._head = 0 if self._is_ros1 else CDR_HEAD
        #: whether it has a header, and the fields, of each type
        self._fields: dict[str, tuple[bool, list[tuple[str, Any]]]] = {}
        self._orders = [
            (struct.Struct(f"{order}I"), struct.Struct(order + ("II" if self._is_ros1 else "iI")))
            for order in "><"
        ]
        self._kind: tuple[Nodetype, Any] = (Nodetype.NAME, normalize_msgtype(topic.type_name))
        try:
            types = store_of(topic).fielddefs if topic.encoding in (CDR, ROS1) else {}
        except BagError:
            types = {}
        for name, (_, fields) in types.items():
            is_none = self._is_ros1 and [each[0] for each in fields] == [_NO_FIELD]
            is_stamped = any(kind == _HEADER for _, kind in fields)
            self._fields[name] = is_stamped, [] if is_none else list(fields)
        if self._kind != _HEADER and not any(is_stamped for is_stamped, _ in self._fields.values()):
            self._fields = {}
        is_stamped, own = self._fields.get(self._kind[1], (False, []))
        wanted = [at for at, (field, kind) in enumerate(own) if kind == _HEADER or field == _CHILD]
        if is_stamped and not inner:
            del own[wanted[-1] + 1 :]

    def __call__(self, data: bytes) -> list[Stamp]:
        """The stamps of a message; none where it does not fit its definition."""
        found: list[Stamp] = []
        if self._fields and (self._is_ros1 or data[:2] in (b"\0\0", b"\0\1")):
            self._number, self._time = self._orders[self._is_ros1 or data[1]]
            self._data, self._found, self._n_left = data, found, len(data) + _MOST_EMPTY
            try:
                end = self._passed(self._kind, self._head, is_inner=False)
            except (struct.error, KeyError, BagError, RecursionError):
                return []
            return found if end <= len(data) else []
        return found

    def moved(self, data: bytes, stamp: Stamp, time_ns: int) -> bytes:
        """The message, of which the stamps were found last, with another time in one of them."""
        time = self._time.pack(*divmod(time_ns, _SECOND_NS))
        return data[: stamp.place] + time + data[stamp.place + len(time) :]

    def _passed(self, kind: tuple[Nodetype, Any], place: int, *, is_inner: bool) -> int:
        """Where a field ends; stamps in it are collected."""
        node, detail = kind
        if kind == _HEADER:
            return self._message((True, [("header", kind)]), place, is_inner)
        if node == Nodetype.NAME:
            return self._message(self._fields[detail], place, is_inner)
        if node == Nodetype.BASE:
            if detail[0] == "string":
                return self._text(place)[1]
            return self._aligned(place, SIZEMAP[detail[0]]) + SIZEMAP[detail[0]]
        element, number = detail
        if node == Nodetype.SEQUENCE:
            place = self._aligned(place, 4)
            (number,) = self._number.unpack_from(self._data, place)
            place += 4
        if number and element[0] == Nodetype.BASE and element[1][0] != "string":
            size: int = SIZEMAP[element[1][0]]
            return self._aligned(place, size) + int(number) * size
        for _ in range(number):
            place = self._passed(element, place, is_inner=is_inner)
        return place

    def _message(
        self, kind_of: tuple[bool, list[tuple[str, Any]]], place: int, is_inner: bool
    ) -> int:
        self._n_left -= 1
        if place > len(self._data) or not self._n_left:
            raise BagError("a message must fit its definition")
        n_before, sender = len(self._found), ""
        is_stamped, fields = kind_of
        for field, kind in fields:
            if kind == _HEADER:
                place = self._aligned(place, 4) + 4 * self._is_ros1  # seq
                second, nanosecond = self._time.unpack_from(self._data, place)
                if not is_inner or self._inner:
                    self._found.append(Stamp(place, second * _SECOND_NS + nanosecond, ""))
                frame, place = self._text(place + self._time.size)
                sender = sender or frame
            elif is_stamped and field == _CHILD:
                child, place = self._text(place)
                sender = child or sender
            else:
                place = self._passed(kind, place, is_inner=is_inner or is_stamped)
        if is_stamped and not is_inner:
            for row in range(n_before, len(self._found)):
                own, time_ns, _ = self._found[row]
                self._found[row] = Stamp(own, time_ns, sender)
        return place

    def _text(self, place: int) -> tuple[str, int]:
        place = self._aligned(place, 4)
        (length,) = self._number.unpack_from(self._data, place)
        end = place + 4 + length
        return self._data[place + 4 : end].rstrip(b"\0").decode(errors="replace"), end

    def _aligned(self, place: int, size: int) -> int:
        return place if self._is_ros1 else place + -(place - self._head) % size
