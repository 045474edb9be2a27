"""Brightness of any image file: photographs by Pillow, multi-band TIFF tiles by tifffile."""

from pathlib import Path
from typing import Any

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.errors import SerdError

#: Share of red, green and blue in perceived brightness (ITU-R BT.601).
BRIGHTNESS = np.array([0.299, 0.587, 0.114])
#: Percentiles that a satellite tile is stretched between; outliers saturate.
STRETCH = (1.0, 99.0)


def image_brightness(path: Path) -> FloatArray:
    """(height, width) brightness in [0, 1], northern row first."""
    if not path.is_file():
        raise SerdError(f"image must be a file, got {path}, which is not there")
    bands = _tile(path) if path.suffix.lower() in (".tif", ".tiff") else _photograph(path)
    return np.asarray(np.clip(bands @ BRIGHTNESS, 0.0, 1.0))


def _photograph(path: Path) -> FloatArray:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGB"), dtype=np.float64) / 255.0
    except (UnidentifiedImageError, OSError) as error:
        raise SerdError(f"image {path} cannot be read: {error}; use PNG, JPEG or TIFF") from error


def _tile(path: Path) -> FloatArray:
    """Red, green and blue of a tile whose bands run from blue on, each stretched to [0, 1]."""
    import tifffile

    try:
        raw: Any = np.asarray(tifffile.imread(path), dtype=np.float64)
    except (tifffile.TiffFileError, OSError, ValueError) as error:
        raise SerdError(f"image {path} cannot be read: {error}; use PNG, JPEG or TIFF") from error
    bands = raw[:, :, None] if raw.ndim == 2 else raw
    if bands.ndim != 3:
        raise SerdError(f"image {path} must have rows, columns and bands, got shape {raw.shape}")
    visible = np.repeat(bands[:, :, :1], 3, axis=2) if bands.shape[2] < 3 else bands[:, :, 2::-1]
    low, high = np.percentile(visible, STRETCH, axis=(0, 1))
    return np.asarray(np.clip((visible - low) / np.maximum(high - low, 1e-12), 0.0, 1.0))
