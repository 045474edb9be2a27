"""Poses and vectors in messages of any type, by the definitions that the bag holds.

A field path names a number, or the message around it: `drive.speed`, `pose.pose`, `poses.0`.
Without one, the nearest message with the fields of a pose or of a velocity is taken.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import store_of
from serd_bag.messages.plain import Header, decode, header_of
from serd_bag.nearest import hint
from serd_bag.topic import Topic

_HEADER = "std_msgs/msg/Header"
_DEEPEST = 6
_Fields = dict[str, tuple[Nodetype, Any]]


class Shape(NamedTuple):
    """A kind of message that has a pose, velocity or vector, by words with spaces between them.

    fields: by which it is recognised; numbers: paths of the numbers in it; types: of geometry_msgs,
    of the messages inside others that may be taken; empty: any.
    """

    fields: str
    numbers: str
    types: str = ""


_TURNED = "{0}.x {0}.y {0}.z {1}.x {1}.y {1}.z {1}.w"
#: x, y, z and quaternion, or x, y and yaw, or x and y.
POSES = (
    Shape("position orientation", _TURNED.format("position", "orientation")),
    Shape("translation rotation", _TURNED.format("translation", "rotation")),
    Shape("x y theta", "x y theta"),
    Shape("x y yaw", "x y yaw"),
    Shape("x y", "x y", types="Point Point32"),
)
#: Forward and left; of a steered vehicle, forward.
VELOCITIES = (
    Shape("linear angular", "linear.x linear.y"),
    Shape("speed steering_angle", "speed"),
)
VECTORS = (Shape("x y", "x y", types="Vector3"),)


class FieldReader(NamedTuple):
    """Reads numbers out of the messages of one topic, by their paths."""

    type_name: str
    store: Typestore
    numbers: tuple[str, ...]

    def __call__(self, data: bytes) -> tuple[Header, tuple[float, ...]]:
        """(header, empty where the type has none; numbers), NaN beyond the end of a list."""
        message = decode(data, self.type_name, self.store)
        header = getattr(message, "header", None)
        known = getattr(header, "__msgtype__", "") == _HEADER
        values = tuple(_number(message, path) for path in self.numbers)
        return (header_of(header) if known else Header(0, "")), values


def field_reader(
    topic: Topic, paths: Sequence[str], shapes: Sequence[Shape], key: str, wanted: str
) -> FieldReader:
    """The reader of a topic; BagError where its type has no such fields.

    paths: of numbers, or one of a message with one of the shapes; empty: the nearest such message.
    key: the mapping's key for the paths; wanted: what is read, for errors.
    """
    store = store_of(topic)
    found = _located(store, topic.type_name, paths, shapes, key)
    if not found:
        fields = ", ".join(_fields(store, topic.type_name)) or "none"
        raise BagError(
            f"{topic.name} must carry {wanted}, got {topic.type_name} with the fields {fields};"
            f" name the topic that does, or the paths of its numbers as {key}"
        )
    return FieldReader(topic.type_name, store, found)


def _located(
    store: Typestore, type_name: str, paths: Sequence[str], shapes: Sequence[Shape], key: str
) -> tuple[str, ...]:
    """Paths of the numbers; empty where there is no message of these shapes."""
    kinds = [_kind(store, type_name, path, key) for path in paths]
    if len(paths) != 1 or not _is_message(kinds[0]):
        wrong = [
            path
            for path, (node, detail) in zip(paths, kinds, strict=True)
            if node != Nodetype.BASE or detail[0] == "string"
        ]
        if wrong:
            raise BagError(
                f"{key} of {type_name} must be paths of numbers, or one of a message, got"
                f" {wrong[0]!r}; go on to a field of it"
            )
        if paths:
            return tuple(paths)
    start = (f"{paths[0]}.", kinds[0][1]) if paths else ("", type_name)
    for shape in shapes:
        for prefix, name in _messages_in(store, *start):
            types = [f"geometry_msgs/msg/{each}" for each in shape.types.split()]
            typed = not types or prefix == start[0] or name in types
            if typed and set(shape.fields.split()) <= _fields(store, name).keys():
                return tuple(prefix + number for number in shape.numbers.split())
    return ()


def _messages_in(store: Typestore, prefix: str, type_name: str) -> Iterator[tuple[str, str]]:
    """(path with a dot at its end, type) of a message and all in it, the nearest first."""
    waiting = deque([(prefix, type_name)])
    while waiting:
        path, name = waiting.popleft()
        yield path, name
        if path.count(".") < prefix.count(".") + _DEEPEST:
            inner = _fields(store, name).items()
            waiting.extend(
                (f"{path}{field}.", kind[1]) for field, kind in inner if _is_message(kind)
            )


def _kind(store: Typestore, type_name: str, path: str, key: str) -> tuple[Nodetype, Any]:
    """What is at the path; BagError where a step of it is no field."""
    kind: tuple[Nodetype, Any] = (Nodetype.NAME, type_name)
    for step in path.split("."):
        fields = _fields(store, kind[1]) if _is_message(kind) else {}
        if kind[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE) and step.isdecimal():
            kind = kind[1][0]
        elif step in fields:
            kind = fields[step]
        else:
            raise BagError(
                f"{key} {path!r} must be a path of fields of {type_name}, got {step!r};"
                f" {hint(step, sorted(fields))}"
            )
    return kind


def _fields(store: Typestore, type_name: str) -> _Fields:
    return dict(store.fielddefs[type_name][1])


def _is_message(kind: tuple[Nodetype, Any]) -> bool:
    return kind[0] == Nodetype.NAME


def _number(message: Any, path: str) -> float:
    for step in path.split("."):
        if not step.isdecimal():
            message = getattr(message, step)
        elif int(step) < len(message):
            message = message[int(step)]
        else:
            return float("nan")
    return float(message)
