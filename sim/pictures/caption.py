"""A line of text below a frame."""

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from sim.pictures.view import Frame

_HEIGHT_PX, _TEXT_PX, _MARGIN_PX = 22, 13, 6
_PAPER, _INK = (255, 255, 255), (38, 50, 61)


def with_caption(frame: Frame, text: str) -> Frame:
    """The frame with a strip below it that says the text."""
    height, width = frame.shape[:2]
    image = Image.new("RGB", (width, height + _HEIGHT_PX), _PAPER)
    image.paste(Image.fromarray(frame), (0, 0))
    ImageDraw.Draw(image).text(
        (_MARGIN_PX, height + _HEIGHT_PX // 2),
        text,
        fill=_INK,
        font=ImageFont.load_default(_TEXT_PX),
        anchor="lm",
    )
    return np.asarray(image)
