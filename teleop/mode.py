"""The two ways to drive by hand."""

from typing import Literal

Mode = Literal["directions", "velocity"]
