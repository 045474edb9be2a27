"""Frames as files: PNG, GIF, and MP4 by the ffmpeg that imageio-ffmpeg brings (extra `movie`).

A movie is written beside its place and moved there when it is whole, so that an interrupted
run leaves no file.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from serd_bag.errors import disk_errors
from serd_sim.errors import SimError

#: (height, width, 3) picture.
Frame = NDArray[np.uint8]


def save_png(frame: Frame, path: str | Path) -> None:
    """Write one frame."""
    with _whole(Path(path)) as part:
        Image.fromarray(frame).save(part, format="PNG", optimize=True)


def save_gif(frames: Iterable[Frame], path: str | Path, frames_per_s: float = 10.0) -> None:
    """Write an endless GIF with one palette for all frames."""
    first, others = _first_and_others(frames)
    palette = Image.fromarray(first).quantize(colors=64)
    images = (
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in others
    )
    with _whole(Path(path)) as part:
        palette.save(
            part,
            format="GIF",
            save_all=True,
            append_images=images,
            duration=round(1000.0 / frames_per_s),
            loop=0,
        )


def save_mp4(frames: Iterable[Frame], path: str | Path, frames_per_s: float = 20.0) -> None:
    """Write an H.264 movie frame by frame; an odd last row or column of pixels is cut off."""
    import imageio_ffmpeg  # of the extra `movie`

    first, others = _first_and_others(frames)
    height, width = first.shape[0] // 2 * 2, first.shape[1] // 2 * 2
    with _whole(Path(path)) as part:
        # imageio scales to whole blocks of pixels; H.264 needs even sizes only.
        writer = imageio_ffmpeg.write_frames(
            str(part), (width, height), fps=frames_per_s, macro_block_size=2, quality=6
        )
        writer.send(None)
        try:
            for frame in chain([first], others):
                writer.send(np.ascontiguousarray(frame[:height, :width]))
        finally:
            writer.close()


#: How frames are written, by the suffix of the file.
MOVIE_WRITERS: dict[str, Callable[[Iterable[Frame], Path, float], None]] = {
    ".gif": save_gif,
    ".mp4": save_mp4,
}


@contextmanager
def _whole(path: Path) -> Iterator[Path]:
    """A path beside this one to write to; moved here at the end, removed after an error."""
    part = path.with_name(f".part-{path.name}")
    try:
        with disk_errors("write", path):
            path.parent.mkdir(parents=True, exist_ok=True)
            yield part
            part.replace(path)
    finally:
        with suppress(NotADirectoryError):
            part.unlink(missing_ok=True)


def _first_and_others(frames: Iterable[Frame]) -> tuple[Frame, Iterator[Frame]]:
    iterator = iter(frames)
    first = next(iterator, None)
    if first is None:
        raise SimError("a movie must have at least one frame, got none; record an episode first")
    return first, iterator


_HEIGHT_PX, _TEXT_PX, _MARGIN_PX = 22, 13, 6
#: Room for the time at the end of a caption.
_NARROWEST_PX = 120
_PAPER, _INK = (255, 255, 255), (38, 50, 61)


def with_caption(frame: Frame, text: str) -> Frame:
    """The frame with a line of text below it, of which a narrow frame has the end."""
    height, width = frame.shape[:2]
    width = max(width, _NARROWEST_PX)
    image = Image.new("RGB", (width, height + _HEIGHT_PX), _PAPER)
    image.paste(Image.fromarray(frame), (0, 0))
    font, shown = ImageFont.load_default(_TEXT_PX), text
    while font.getlength(shown) > width - 2 * _MARGIN_PX:
        text = text[1:]
        shown = f"…{text}"
    ImageDraw.Draw(image).text(
        (_MARGIN_PX, height + _HEIGHT_PX // 2), shown, fill=_INK, font=font, anchor="lm"
    )
    return np.asarray(image)
