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
from serd_bag.messages.fields import store_of
from serd_bag.messages.plain import CDR_HEAD
from serd_bag.topic import CDR, ROS1, Topic

_SECOND_NS = 1_000_000_000
_HEADER = (Nodetype.NAME, "std_msgs/msg/Header")
#: What a step passes over: bytes, a text, a header, the name of a child frame, or messages.
_BYTES, _TEXT, _STAMP, _CHILD, _MESSAGES = range(5)
#: Fields of a type, with those of its parts; real ones have a few hundred.
_MOST_FIELDS = 10_000


class Stamp(NamedTuple):
    """A stamp in a message; place: its first byte of eight; time_ns: 0 where it is not set."""

    place: int
    time_ns: int
    sender: str


class _Step(NamedTuple):
    """Fields that follow each other; number: of bytes, or of messages, None where the data states
    it; steps: of each message."""

    kind: int
    align: int = 1
    number: int | None = None
    steps: "tuple[_Step, ...]" = ()

    @property
    def has_stamp(self) -> bool:
        return self.kind == _STAMP or any(step.has_stamp for step in self.steps)


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
        self._n_fields = 0
        try:
            types = store_of(topic).fielddefs if topic.encoding in (CDR, ROS1) else {}
            name = normalize_msgtype(topic.type_name)
            is_header = name == _HEADER[1]
            steps = self._steps_over(types, _HEADER) if is_header else self._steps_of(types, name)
        except (BagError, KeyError, RecursionError):
            steps = ()
        only_own = not inner and any(step.kind == _STAMP for step in steps)
        ends = [
            number
            for number, step in enumerate(steps, 1)
            if step.kind in (_STAMP, _CHILD) or (step.has_stamp and not only_own)
        ]
        self._steps = steps[: max(ends, default=0)]

    def __call__(self, data: bytes) -> list[Stamp]:
        """The stamps of a message; none where it does not fit its definition."""
        found: list[Stamp] = []
        if self._steps and (self._is_ros1 or data[:2] in (b"\0\0", b"\0\1")):
            order = "<" if self._is_ros1 or data[1] else ">"
            self._number = struct.Struct(order + "I")
            self._time = struct.Struct(order + ("II" if self._is_ros1 else "iI"))
            try:
                self._pass(self._steps, data, self._head, found, False)
            except (struct.error, BagError):
                return []
        return found

    def moved(self, data: bytes, stamp: Stamp, time_ns: int) -> bytes:
        """The message, of which the stamps were found last, with another time in one of them."""
        time = self._time.pack(*divmod(time_ns, _SECOND_NS))
        return data[: stamp.place] + time + data[stamp.place + len(time) :]

    def _steps_of(self, types: Any, name: str) -> tuple[_Step, ...]:
        """The steps over a message; those over plain bytes are joined."""
        made: list[_Step] = []
        fields = types[name][1]
        if self._is_ros1 and fields[0][0] == "structure_needs_at_least_one_member":
            return ()
        is_stamped = any(kind == _HEADER for _, kind in fields)
        for field, kind in fields:
            for step in self._steps_over(types, kind):
                if is_stamped and field == "child_frame_id" and step.kind == _TEXT:
                    step = step._replace(kind=_CHILD)
                last = made[-1] if made else None
                if last and step.kind == last.kind == _BYTES and step.align == last.align:
                    step = step._replace(number=(last.number or 0) + (step.number or 0))
                    made.pop()
                made.append(step)
        return tuple(made)

    def _steps_over(self, types: Any, kind: tuple[Nodetype, Any]) -> tuple[_Step, ...]:
        node, detail = kind
        self._n_fields += 1
        if self._n_fields > _MOST_FIELDS:
            raise BagError("a definition must have fewer fields")
        align = 1 if self._is_ros1 else 4
        if kind == _HEADER:
            return (_Step(_STAMP, align),)
        if node == Nodetype.BASE:
            if detail[0] == "string":
                return (_Step(_TEXT, align),)
            size = SIZEMAP[detail[0]]
            return (_Step(_BYTES, 1 if self._is_ros1 else size, size),)
        if node == Nodetype.NAME:
            steps = self._steps_of(types, detail)
            has_stamp = any(step.has_stamp for step in steps)
            return (_Step(_MESSAGES, 1, 1, steps),) if has_stamp else steps
        steps = self._steps_over(types, detail[0])
        if node == Nodetype.ARRAY:
            return (_Step(_MESSAGES, 1, detail[1], steps),)
        return (_Step(_MESSAGES, align, None, steps),)

    def _pass(
        self, steps: tuple[_Step, ...], data: bytes, place: int, found: list[Stamp], is_inner: bool
    ) -> int:
        """Collect the stamps in a message that begins at a place; returns where it ends."""
        n_before, sender = len(found), None
        is_stamped = any(step.kind == _STAMP for step in steps)
        for kind, align, number, inside in steps:
            place += -(place - self._head) % align
            if kind == _BYTES:
                place += number or 0
                continue
            if kind == _MESSAGES:
                if number is None:
                    (number,) = self._number.unpack_from(data, place)
                    place += 4
                if number and len(inside) == 1 and inside[0].kind == _BYTES:
                    place += -(place - self._head) % inside[0].align
                    place += number * (inside[0].number or 0)
                    continue
                for _ in range(number):
                    before = place
                    place = self._pass(inside, data, place, found, is_inner or is_stamped)
                    if place == before:
                        break  # messages without bytes
                continue
            if kind == _STAMP:
                place += 4 * self._is_ros1  # seq
                second, nanosecond = self._time.unpack_from(data, place)
                if not is_inner or self._inner:
                    found.append(Stamp(place, second * _SECOND_NS + nanosecond, ""))
                place += self._time.size
            (length,) = self._number.unpack_from(data, place)
            begin, place = place + 4, place + 4 + length
            if kind == _CHILD or (kind == _STAMP and not sender):
                text = data[begin:place].rstrip(b"\0").decode(errors="replace")
                sender = text or sender
        if place > len(data):
            raise BagError("a message must fit its definition")
        if is_stamped and not is_inner:
            found[n_before:] = [each._replace(sender=sender or "") for each in found[n_before:]]
        return place
