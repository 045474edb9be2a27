"""Rules for received messages; a MessageError names the rule, the received value and the fix."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from std_msgs.msg import Header

from serd_ros.errors import MessageError

#: Lengths in metres, speeds in m/s: beyond is no measurement, and arithmetic would overflow.
LARGEST = 1e6


def require_finite(name: str, values: ArrayLike) -> None:
    """Require numbers between -LARGEST and LARGEST."""
    with np.errstate(invalid="ignore"):  # a signalling NaN
        numbers = np.asarray(values, dtype=np.float64)
    sound = np.abs(numbers) <= LARGEST
    if not sound.all():
        raise MessageError(
            f"{name} must be finite and at most {LARGEST:g}",
            repr(float(numbers[~sound][0])),
            "correct what publishes it",
        )


def require_frame(header: Header, *frames: str) -> None:
    """Require one of these frames."""
    if header.frame_id not in frames:
        raise MessageError(
            f"frame_id must be {' or '.join(map(repr, frames))}",
            repr(header.frame_id),
            f"transform it to {frames[0]!r} before it is published",
        )


def require_one_of(name: str, value: str, choices: Sequence[str]) -> str:
    """The value, which must be one of the choices."""
    if value not in choices:
        known = ", ".join(map(repr, choices))
        raise MessageError(f"{name} must be one of {known}", repr(value), "publish one of them")
    return value
