"""A map of ROS as a raster: image and YAML file of nav2_map_server.

Shades become occupancies as in nav2_map_server: p = 1 - shade (`negate`: the shade), occupied above
`occupied_thresh`, free below `free_thresh`, between them unknown (the mode trinary). The shade 205
of 255 is always unknown: map_saver writes it for unknown cells, and beside it a `free_thresh` of
0.25, which it lies below.
"""

from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydantic import ConfigDict, Field, model_validator

from serd_bag.errors import FileError
from serd_bag.files import read_bytes
from serd_core.arrays import FloatArray
from serd_files.yaml_config import StrictModel, load_yaml_model
from serd_sim.scenario.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyRaster

_SHADE_OF_UNKNOWN = 205 / 255


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
    mode: Literal["trinary"] = "trinary"

    @model_validator(mode="after")
    def _thresholds_in_order(self) -> "MapFile":
        if self.free_thresh >= self.occupied_thresh:
            raise ValueError(
                f"free_thresh must be below occupied_thresh ({self.occupied_thresh:g}), got"
                f" {self.free_thresh:g}; lower it"
            )
        return self


def read_map(path: Path) -> OccupancyRaster:
    """The map of a YAML file; FileError where it is none."""
    if path.suffix not in {".yaml", ".yml"}:
        raise FileError(
            f"{path} must be the YAML file of a map; nav2_map_server's map_saver writes one of a"
            " topic"
        )
    described = load_yaml_model(path, MapFile)
    cells = _occupancies(_image(path, described), described)
    x_m, y_m, yaw_rad = described.origin
    return OccupancyRaster((x_m, y_m), described.resolution, cells[::-1], yaw_rad)


def read_shades(path: Path, points_m: FloatArray) -> FloatArray:
    """The blackness (N,), from 0 to 1, of a map at points (N, 2); FileError where one is beside."""
    described = load_yaml_model(path, MapFile)
    shade = _image(path, described)[:, :, :3].mean(axis=2)
    black = (shade if described.negate else 1.0 - shade)[::-1]
    x_m, y_m, yaw_rad = described.origin
    east, north = (points_m - (x_m, y_m)).T
    along = np.cos(yaw_rad) * east + np.sin(yaw_rad) * north
    across = np.cos(yaw_rad) * north - np.sin(yaw_rad) * east
    column, row = (
        np.floor(each / described.resolution).astype(np.int64) for each in (along, across)
    )
    inside = (row >= 0) & (row < black.shape[0]) & (column >= 0) & (column < black.shape[1])
    if not inside.all():
        beside = points_m[int(np.argmin(inside))]
        raise FileError(
            f"{path}: the raster must cover all cells, it ends before ({beside[0]:g},"
            f" {beside[1]:g}) m; make it larger or correct its origin"
        )
    return np.asarray(black[row, column])


def _image(path: Path, described: MapFile) -> FloatArray:
    """(H, W, 3 or 4) colours of the image of a map; FileError where it cannot be read."""
    image_path = path.parent / described.image
    read_bytes(image_path)  # FileError with the reason where it cannot be read
    try:
        with Image.open(image_path) as image:
            return _channels(image)
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise FileError(
            f"{image_path}: must be an image (PGM, PNG or BMP), got another file ({error})"
        ) from None


def _channels(image: Image.Image) -> FloatArray:
    """(H, W, 3 or 4) colours, and opacity where the image has it, from 0 to 1."""
    if image.mode.startswith(("I", "F")):  # 16 bits of grey
        grey = np.asarray(image, dtype=np.float64) / 65535.0
        return np.repeat(grey[:, :, None], 3, axis=2)
    transparent = "A" in image.getbands() or "transparency" in image.info
    pixels = np.asarray(image.convert("RGBA" if transparent else "RGB"))
    return np.asarray(pixels / 255.0, dtype=np.float64)


def _occupancies(channels: FloatArray, described: MapFile) -> NDArray[np.int8]:
    """(H, W) int8: FREE, OCCUPIED or UNKNOWN; channels (H, W, 3 or 4) from 0 to 1."""
    shade = channels.mean(axis=2)
    occupied = shade if described.negate else 1.0 - shade
    cells = np.full(shade.shape, UNKNOWN)
    cells[occupied > described.occupied_thresh] = OCCUPIED
    cells[occupied < described.free_thresh] = FREE
    cells[np.isclose(shade, _SHADE_OF_UNKNOWN)] = UNKNOWN
    return cells.astype(np.int8)
