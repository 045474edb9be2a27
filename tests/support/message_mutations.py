"""Structured mutations of ROS messages: their fields by type, or the bytes of their CDR."""

import array
import random
from collections.abc import Callable, Iterator
from copy import deepcopy
from functools import partial
from operator import setitem
from typing import Any

import numpy as np
from rclpy.serialization import serialize_message

_FLOATS = (
    float("nan"), float("inf"), -float("inf"), 0.0, -0.0, 5e-324, 1e-9, 1.0, -1.0, 0.5, 1e3, -1e3,
    1e6, 1.1e6, -1e9, 1e30, -3e38,
)  # fmt: skip
_DOUBLES = (*_FLOATS, 1e300, -1.7e308)
_TEXTS = (
    "", " ", "map", "odom", "base_link", "/map", "laser", "x", "-1", "0", "1e400", "nan", "9" * 30,
    "9" * 5000, "é😀", "\n", "\x01", "true", "True", "start", "end", "arrived", "x" * 20_000,
    "episode", "hallway_sim", "teleop_mux", "demo_recorder", "{a: [", "!!float x",
)  # fmt: skip
_INTEGERS = {
    f"{'' if signed else 'u'}int{bits}": (
        *({-(2 ** (bits - 1)), -1} if signed else ()),
        0, 1, 2, 3, 7, 100, 2 ** (bits - 1) - 1, 2 ** (bits - signed) - 1,
    )
    for bits in (8, 16, 32, 64)
    for signed in (True, False)
}  # fmt: skip
#: Places that mutations of one value hardly reach by chance.
_SECONDS = (0, 1, 9, 99, 101, 103, 10_000, 1_800_000_000, 2**31 - 1, -1, -(2**31))

Setter = Callable[[Any], None]
Place = tuple[str, Any, Setter]


def mutated(message: Any, rng: random.Random) -> Any:
    """A copy with up to three of its fields changed."""
    changed = deepcopy(message)
    for _ in range(rng.choice((1, 1, 2, 3))):
        places = list(_places(changed))
        if not places:
            return changed
        # Few places hold arrays; each kind of place has the same chance.
        kinds = sorted({_group(kind, value) for kind, value, _ in places})
        group = rng.choice(kinds)
        kind, value, put = rng.choice([each for each in places if _group(*each[:2]) == group])
        put(_another(kind, value, rng))
    return changed


def mutated_cdr(message: Any, rng: random.Random) -> bytes:
    """The bytes of the message, which may be bytes already, cut off, overwritten or replaced."""
    data = bytearray(message if isinstance(message, bytes) else serialize_message(message))
    way = rng.random()
    if way < 0.3:
        del data[rng.randrange(len(data)) :]
    elif way < 0.5:
        data[4:] = rng.randbytes(rng.randrange(200))
    else:
        for _ in range(rng.randrange(1, 5)):
            data[rng.randrange(len(data))] = rng.choice((0, 1, 127, 255, rng.randrange(256)))
    return bytes(data)


def _group(kind: str, value: Any) -> str:
    if kind.endswith("]") or kind.startswith("sequence"):
        return "array"
    return kind if kind in ("string", "bool", "sec") else type(value).__name__


def _places(message: Any) -> Iterator[Place]:
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if name == "structure_needs_at_least_one_member":
            continue
        if hasattr(value, "get_fields_and_field_types"):
            yield from _places(value)
            continue
        yield ("sec" if name == "sec" else kind), value, partial(setattr, message, name)
        if isinstance(value, list):
            for index, item in enumerate(value[:20]):
                if hasattr(item, "get_fields_and_field_types"):
                    yield from _places(item)
                else:
                    yield _element_kind(kind), item, partial(setitem, value, index)


def _element_kind(kind: str) -> str:
    return kind.removeprefix("sequence<").partition(">")[0].partition(",")[0].partition("[")[0]


def _another(kind: str, value: Any, rng: random.Random) -> Any:
    if kind == "sec":
        return rng.choice(_SECONDS)
    if isinstance(value, np.ndarray | array.array | list):
        return _another_array(kind, value, rng)
    if isinstance(value, bool):
        return not value
    if isinstance(value, bytes):
        return bytes([rng.choice((0, 1, 3, 4, 200, 255))])
    if isinstance(value, str):
        return rng.choice((*_TEXTS, value[: len(value) // 2], value + value))
    if isinstance(value, float):
        return rng.choice(_DOUBLES if kind == "double" else _FLOATS)
    near = value + rng.choice((-1, 1, 4))
    most = max(_INTEGERS[kind])
    return rng.choice((*_INTEGERS[kind], min(max(near, min(_INTEGERS[kind])), most)))


def _another_array(kind: str, value: Any, rng: random.Random) -> Any:
    if isinstance(value, np.ndarray):  # of fixed length
        changed = value.copy()
        changed[rng.randrange(len(changed))] = rng.choice(_DOUBLES)
        return changed
    way = rng.choice(("cut", "cut", "repeat", "grow", "elements", "elements"))
    if isinstance(value, array.array) and not value:
        value = array.array(value.typecode, [0] * rng.choice((0, 1, 7, 1000)))
    size = len(value)
    if way == "cut" or not size:
        return value[: rng.randrange(size or 1)]
    if way == "repeat":
        return value + value[: rng.randrange(1, size + 1)]
    if way == "grow":
        return value * (20_000 // size + 1) if isinstance(value, array.array) else value * 50
    if not isinstance(value, array.array):
        return rng.sample(value, size)
    changed = array.array(value.typecode, value)
    for _ in range(rng.choice((1, 3, size))):
        changed[rng.randrange(size)] = _another(_element_kind(kind), value[0], rng)
    return changed
