"""Pictures compared pixel by pixel."""

from pathlib import Path

import numpy as np
from PIL import Image, ImageSequence

#: Of a pixel, by rounding; of all pixels.
OTHER_PIXEL, MOST_OTHER = 0.1, 1e-3


def share_of_other_pixels(one: Path, other: Path) -> float:
    """The share of pixels of all frames of which a channel differs; 1 where the sizes do."""
    first, second = _frames(one), _frames(other)
    if [frame.shape for frame in first] != [frame.shape for frame in second]:
        return 1.0
    apart = [np.abs(a - b).max(axis=2) > OTHER_PIXEL for a, b in zip(first, second, strict=True)]
    return float(np.mean([each.mean() for each in apart]))


def _frames(path: Path) -> list[np.ndarray]:
    with Image.open(path) as picture:
        frames = ImageSequence.Iterator(picture)
        return [np.asarray(frame.convert("RGBA"), dtype=np.float32) / 255 for frame in frames]
