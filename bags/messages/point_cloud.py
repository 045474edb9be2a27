"""Named fields of a sensor_msgs/PointCloud2 as arrays."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from bags.errors import BagError
from bags.messages.plain import Header, decode, header_of
from serd_core.arrays import FloatArray

_KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


@dataclass(frozen=True, eq=False)
class Cloud:
    """fields: each (N,) as float."""

    header: Header
    fields: dict[str, FloatArray]


def point_cloud(data: bytes, names: tuple[str, ...]) -> Cloud:
    """The named fields; BagError where one is missing or the sizes do not fit."""
    cloud = decode(data, "sensor_msgs/msg/PointCloud2")
    layout = {each.name: each for each in cloud.fields}
    for each in cloud.fields:
        if each.datatype not in _KINDS:
            raise BagError(
                f"point field {each.name} must have a datatype from 1 to 8, got {each.datatype}"
            )
    missing = [name for name in names if name not in layout]
    if missing:
        raise BagError(f"point cloud must have the field {missing[0]}, got {', '.join(layout)}")
    size = cloud.height * cloud.width * cloud.point_step
    if cloud.data.nbytes != size:
        raise BagError(f"point cloud must have {size} bytes of points, got {cloud.data.nbytes}")
    order = ">" if cloud.is_bigendian else "<"
    kinds = {
        "names": list(names),
        "formats": [order + _KINDS[layout[name].datatype] for name in names],
        "offsets": [layout[name].offset for name in names],
        "itemsize": cloud.point_step,
    }
    try:
        points: Any = np.frombuffer(cloud.data, dtype=np.dtype(kinds))  # type: ignore[call-overload]
    except ValueError as error:
        raise BagError(f"point cloud has fields that do not fit ({error})") from None
    fields = {name: points[name].astype(np.float64) for name in names}
    return Cloud(header_of(cloud.header), fields)
