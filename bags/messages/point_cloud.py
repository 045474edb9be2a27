"""Named fields of a sensor_msgs/PointCloud2 as arrays."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from bags.errors import BagError
from bags.messages.cdr import CdrCursor
from bags.messages.plain import Header, read_header
from serd_core.arrays import FloatArray

_KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


@dataclass(frozen=True, eq=False)
class Cloud:
    """fields: each (N,) as float."""

    header: Header
    fields: dict[str, FloatArray]


def point_cloud(data: bytes, names: tuple[str, ...]) -> Cloud:
    """The named fields; BagError where one is missing or the sizes do not fit."""
    cursor = CdrCursor(data)
    header = read_header(cursor)
    rows, columns = int(cursor.number("I")), int(cursor.number("I"))
    layout = {name: (offset, kind) for name, offset, kind in _fields(cursor)}
    order = ">" if cursor.number("B") else "<"
    step, _ = int(cursor.number("I")), cursor.number("I")
    content = cursor.raw(cursor.length())
    missing = [name for name in names if name not in layout]
    if missing:
        raise BagError(f"point cloud must have the field {missing[0]}, got {', '.join(layout)}")
    if len(content) != rows * columns * step:
        size = rows * columns * step
        raise BagError(f"point cloud must have {size} bytes of points, got {len(content)}")
    kinds = {
        "names": list(names),
        "formats": [order + _KINDS[layout[name][1]] for name in names],
        "offsets": [layout[name][0] for name in names],
        "itemsize": step,
    }
    try:
        points: Any = np.frombuffer(content, dtype=np.dtype(kinds))  # type: ignore[call-overload]
    except ValueError as error:
        raise BagError(f"point cloud has fields that do not fit ({error})") from None
    return Cloud(header, {name: points[name].astype(np.float64) for name in names})


def _fields(cursor: CdrCursor) -> list[tuple[str, int, int]]:
    fields = []
    for _ in range(cursor.length()):
        name, offset = cursor.text(), int(cursor.number("I"))
        kind, _ = int(cursor.number("B")), cursor.number("I")
        if kind not in _KINDS:
            raise BagError(f"point field {name} must have a datatype from 1 to 8, got {kind}")
        fields.append((name, offset, kind))
    return fields
