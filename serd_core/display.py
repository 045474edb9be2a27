"""How records are shown: briefly as text, and as tables in notebooks."""

from collections.abc import Iterable
from dataclasses import fields
from html import escape
from typing import Any

import numpy as np

#: Numbers of an array, and characters, that are shown.
MOST_NUMBERS, MOST_CHARACTERS = 6, 60


class Record:
    """Base of dataclasses that hold arrays, whose text names the sizes of large ones."""

    def __repr__(self) -> str:
        parts: Any = fields(self)  # type: ignore[arg-type]
        shown = (f"{part.name}={brief(getattr(self, part.name))}" for part in parts)
        return f"{type(self).__name__}({', '.join(shown)})"


def brief(value: object) -> str:
    """The value as text, or where that is long its class, of an array its shape."""
    long = f"<{type(value).__name__}>"
    if isinstance(value, np.ndarray):
        long = f"<{value.dtype} {value.shape}>"
        value = value.tolist() if value.size <= MOST_NUMBERS else value
    text = repr(value)
    return text if len(text) <= MOST_CHARACTERS and not isinstance(value, np.ndarray) else long


def html_table(caption: str, *rows: Iterable[object]) -> str:
    """A table of HTML, the first row of which is its header; texts are escaped."""
    cells = ["".join(f"<td>{escape(str(cell))}</td>" for cell in row) for row in rows]
    cells[0] = cells[0].replace("td>", "th>")
    body = "".join(f"<tr>{row}</tr>" for row in cells)
    return f"<table><caption>{escape(caption)}</caption>{body}</table>"
