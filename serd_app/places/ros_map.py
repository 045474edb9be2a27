"""A map of ROS as a raster: image and YAML file of nav2_map_server, or an OccupancyGrid of a bag.

Shades become occupancies as in nav2_map_server: p = 1 - shade (`negate`: the shade), occupied above
`occupied_thresh`, free below `free_thresh`; between them unknown (trinary) or p in percent (scale).
In a trinary map the shade 205 of 255 is always unknown: map_saver writes it for unknown cells, and
beside it a `free_thresh` of 0.25, which it lies below.
"""

import math
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydantic import ConfigDict, Field, model_validator

from serd_app.errors import AppError
from serd_bag.errors import FileError
from serd_bag.files import read_bytes
from serd_bag.messages.plain import decode, yaw_of_quaternion
from serd_bag.reader import BagReader
from serd_bag.topic import topic_named
from serd_core.arrays import FloatArray
from serd_files.yaml_config import StrictModel, load_yaml_model
from serd_sim.scenario.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyRaster

_SHADE_OF_UNKNOWN = 205 / 255
OCCUPANCY_GRID = "nav_msgs/msg/OccupancyGrid"


class MapFile(StrictModel):
    """The YAML file of nav2_map_server; other keys are left. origin: x, y (m) and yaw (rad) of the
    lower-left corner of the image."""

    model_config = ConfigDict(extra="ignore")

    image: str = Field(min_length=1)
    resolution: float = Field(gt=0, le=1e6)
    origin: tuple[float, float, float]
    negate: bool | Literal[0, 1] = False
    occupied_thresh: float = Field(default=0.65, ge=0, le=1)
    free_thresh: float = Field(default=0.25, ge=0, le=1)
    mode: Literal["trinary", "scale", "raw"] = "trinary"

    @model_validator(mode="after")
    def _thresholds_in_order(self) -> "MapFile":
        if self.free_thresh >= self.occupied_thresh:
            raise ValueError(
                f"free_thresh must be below occupied_thresh ({self.occupied_thresh:g}), got"
                f" {self.free_thresh:g}; lower it"
            )
        return self


def read_map(path: Path, topic: str = "map") -> OccupancyRaster:
    """The map of a YAML file, or the last one on a topic of a bag; FileError or BagError."""
    if path.suffix not in {".yaml", ".yml"}:
        return _map_of_bag(path, topic)
    described = load_yaml_model(path, MapFile)
    image_path = path.parent / described.image
    read_bytes(image_path)  # FileError with the reason where it cannot be read
    try:
        with Image.open(image_path) as image:
            cells = _occupancies(_channels(image), described)
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise FileError(
            f"{image_path}: must be an image (PGM, PNG or BMP), got another file ({error})"
        ) from None
    x_m, y_m, yaw_rad = described.origin
    return OccupancyRaster((x_m, y_m), described.resolution, cells[::-1], yaw_rad)


def _channels(image: Image.Image) -> FloatArray:
    """(H, W, 3 or 4) colours, and opacity where the image has it, from 0 to 1."""
    if image.mode.startswith(("I", "F")):  # 16 bits of grey
        grey = np.asarray(image, dtype=np.float64) / 65535.0
        return np.repeat(grey[:, :, None], 3, axis=2)
    transparent = "A" in image.getbands() or "transparency" in image.info
    pixels = np.asarray(image.convert("RGBA" if transparent else "RGB"))
    return np.asarray(pixels / 255.0, dtype=np.float64)


def _occupancies(channels: FloatArray, described: MapFile) -> NDArray[np.int8]:
    """(H, W) int8 from 0 (free) to 100, UNKNOWN; channels (H, W, 3 or 4) from 0 to 1."""
    averaged = channels if described.mode == "trinary" else channels[:, :, :3]
    shade = averaged.mean(axis=2)
    if described.mode == "raw":
        percent = np.round(255.0 * shade)
        return np.where(percent <= OCCUPIED, percent, UNKNOWN).astype(np.int8)
    occupied = shade if described.negate else 1.0 - shade
    cells = np.full(shade.shape, float(UNKNOWN))
    if described.mode == "scale":
        span = described.occupied_thresh - described.free_thresh
        cells = np.rint(100.0 * (occupied - described.free_thresh) / span)
    cells[occupied > described.occupied_thresh] = OCCUPIED
    cells[occupied < described.free_thresh] = FREE
    if described.mode == "trinary":
        cells[np.isclose(shade, _SHADE_OF_UNKNOWN)] = UNKNOWN
    if described.mode == "scale" and channels.shape[2] == 4:
        cells[channels[:, :, 3] < 1.0] = UNKNOWN
    return cells.astype(np.int8)


def _map_of_bag(path: Path, topic: str) -> OccupancyRaster:
    reader = BagReader(path)
    name = topic_named(reader.topics, topic)
    type_name = reader.topics[name].type_name
    if type_name != OCCUPANCY_GRID:
        raise AppError(
            f"bag {path}: the map on {name} must be of type {OCCUPANCY_GRID}, got {type_name};"
            " name its topic with --topic"
        )
    last = None
    for message in reader.messages([name]):
        last = message.data
    if last is None:
        raise AppError(f"bag {path}: {name} must hold a map, it holds no message; record it again")
    grid = decode(last, OCCUPANCY_GRID)
    info, shape = grid.info, (grid.info.height, grid.info.width)
    cells = np.asarray(grid.data, dtype=np.int8)
    origin, turned = info.origin.position, info.origin.orientation
    numbers = (origin.x, origin.y, turned.x, turned.y, turned.z, turned.w)
    if cells.size != shape[0] * shape[1] or not all(map(math.isfinite, numbers)):
        raise AppError(
            f"bag {path}: {name}: the map must have {shape[0]} x {shape[1]} cells and a finite"
            f" origin, got {cells.size} cells; look at what published it"
        )
    if not 0.0 < info.resolution < math.inf:
        raise AppError(
            f"bag {path}: {name}: the map's resolution must be finite and greater than 0 m, got"
            f" {info.resolution:g}; look at what published it"
        )
    yaw_rad = yaw_of_quaternion(turned.x, turned.y, turned.z, turned.w)
    # resolution is a float32 in the message
    resolution_m = float(f"{info.resolution:.7g}")
    return OccupancyRaster((origin.x, origin.y), resolution_m, cells.reshape(shape), yaw_rad)
