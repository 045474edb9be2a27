"""Landscapes for the gridworld of section 4.6.2: brightness and terrain on square cells.

Terrain by a stated rule: a cell is forest where its *roughness* is above Otsu's threshold over all
cells. Roughness is the mean absolute difference between the brightness and the same smoothed by a
tenth of a cell: crowns and their shadows are rough at that scale, lawns, water and roads are not.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.ndimage
from PIL import Image

from serd_core.arrays import BoolArray, FloatArray
from serd_core.checks import float_array
from serd_core.errors import SerdError

SMOOTHING_CELLS = 0.1
#: Share of red, green and blue in perceived brightness (ITU-R BT.601).
BRIGHTNESS = np.array([0.299, 0.587, 0.114])


@dataclass(frozen=True, eq=False)
class Landscape:
    """(rows, columns) mean brightness in [0, 1] and forest mask; row 0 is the southern one."""

    brightness: FloatArray
    forest: BoolArray


def landscape_of_image(image: FloatArray, side: int) -> Landscape:
    """Cut an (height, width) brightness image, northern row first, into side x side cells."""
    pixels = float_array("image", image, (None, None))
    if min(pixels.shape) < side:
        raise SerdError(f"image must have at least {side} pixels a side, got {pixels.shape}")
    sigma = SMOOTHING_CELLS * np.sqrt(pixels.size) / side
    rough = np.abs(pixels - scipy.ndimage.gaussian_filter(pixels, sigma))
    roughness = cell_means(rough, side)
    forest = roughness > otsu_threshold(roughness)
    brightness = stretched(cell_means(pixels, side))
    return Landscape(brightness=brightness[::-1], forest=forest[::-1])


def generated_landscape(side: int, rng: np.random.Generator) -> Landscape:
    """A made-up landscape: smooth hills of brightness, forest in dark parts, one bright road."""
    hills = stretched(scipy.ndimage.gaussian_filter(rng.random((side, side)), side / 10.0))
    column = np.arange(side)
    bend = 0.15 * side * np.sin(2.0 * np.pi * (column / side + rng.random()))
    road_row = np.clip(np.rint(side * rng.uniform(0.35, 0.65) + bend), 0, side - 1).astype(int)
    forest = hills < np.quantile(hills, 0.45)
    brightness = 0.7 * hills
    brightness[road_row, column] = 1.0
    forest[road_row, column] = False
    return Landscape(brightness=stretched(brightness), forest=forest)


def cell_means(image: FloatArray, side: int) -> FloatArray:
    """(side, side) mean of each cell; cells differ by at most one pixel in size."""
    rows = np.linspace(0, image.shape[0], side + 1).astype(int)[:-1]
    columns = np.linspace(0, image.shape[1], side + 1).astype(int)[:-1]
    sums = np.add.reduceat(np.add.reduceat(image, rows, axis=0), columns, axis=1)
    ones = np.ones_like(image)
    sizes = np.add.reduceat(np.add.reduceat(ones, rows, axis=0), columns, axis=1)
    return np.asarray(sums / sizes)


def stretched(values: FloatArray) -> FloatArray:
    """Values scaled to [0, 1]; SerdError where all are equal."""
    low, high = float(values.min()), float(values.max())
    if not high > low:
        raise SerdError(f"image must not be of one brightness, got {low} everywhere")
    return np.asarray((values - low) / (high - low))


def otsu_threshold(values: FloatArray) -> float:
    """Threshold that separates the values into two classes of largest between-class variance."""
    ordered = np.sort(values, axis=None)
    below = np.arange(1, len(ordered))
    sums = np.cumsum(ordered)
    mean_low = sums[:-1] / below
    mean_high = (sums[-1] - sums[:-1]) / (len(ordered) - below)
    between = below * (len(ordered) - below) * (mean_high - mean_low) ** 2
    place = int(np.argmax(between))
    return float((ordered[place] + ordered[place + 1]) / 2.0)


def image_brightness(path: Path) -> FloatArray:
    """(height, width) brightness in [0, 1] of a photograph, northern row first."""
    if not path.is_file():
        raise SerdError(f"image must be a file, got {path}, which is not there")
    try:
        with Image.open(path) as image:
            colours = np.asarray(image.convert("RGB"), dtype=np.float64) / 255.0
    except (OSError, ValueError) as error:
        raise SerdError(f"image {path} cannot be read: {error}; use PNG or JPEG") from error
    return np.asarray(colours @ BRIGHTNESS)
