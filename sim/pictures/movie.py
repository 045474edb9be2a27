"""Frames as files: PNG, GIF, and MP4 where ffmpeg is installed."""

import shutil
import subprocess
from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sim.errors import SimError

Frame = NDArray[np.uint8]


def save_png(frame: Frame, path: str | Path) -> None:
    """Write one frame."""
    Image.fromarray(frame).save(path, format="PNG", optimize=True)


def save_gif(frames: Iterable[Frame], path: str | Path, frames_per_s: float = 10.0) -> None:
    """Write an endless GIF with one palette for all frames."""
    first, others = _first_and_others(frames)
    palette = Image.fromarray(first).quantize(colors=64)
    images = (Image.fromarray(frame).quantize(palette=palette) for frame in others)
    palette.save(
        path,
        format="GIF",
        save_all=True,
        append_images=images,
        duration=round(1000.0 / frames_per_s),
        loop=0,
    )


def save_mp4(frames: Iterable[Frame], path: str | Path, frames_per_s: float = 20.0) -> None:
    """Write an H.264 movie through ffmpeg; SimError when ffmpeg is missing or fails."""
    program = shutil.which("ffmpeg")
    if program is None:
        raise SimError(
            "an MP4 needs the program ffmpeg, which is not installed"
            "; run 'apt-get install ffmpeg' or save a GIF"
        )
    first, others = _first_and_others(frames)
    height, width = first.shape[0] // 2 * 2, first.shape[1] // 2 * 2
    command = [program, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{width}x{height}", "-r", str(frames_per_s), "-i", "-"]
    command += ["-pix_fmt", "yuv420p", str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        even = (frame[:height, :width].tobytes() for frame in chain([first], others))
        _, message = process.communicate(b"".join(even))
    if process.returncode != 0:
        raise SimError(f"ffmpeg could not write {path}: {message.decode().strip()}; save a GIF")


def _first_and_others(frames: Iterable[Frame]) -> tuple[Frame, Iterator[Frame]]:
    iterator = iter(frames)
    first = next(iterator, None)
    if first is None:
        raise SimError("a movie must have at least one frame, got none; record an episode first")
    return first, iterator
