"""Simulated time to and from builtin_interfaces/Time, jumps of its clock, rules for all messages.

Exact to the nanosecond for a month of simulated time; beyond, seconds as a double are not. Where a
received message breaks a rule, a MessageError names the rule, the received value and the fix.
"""

from collections.abc import Sequence
from enum import Enum

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import ArrayLike
from std_msgs.msg import Header

from serd_bag.messages.times import RESTART_NS
from serd_ros.errors import MessageError

#: Lengths in metres, speeds in m/s: beyond is no measurement, and arithmetic would overflow.
LARGEST = 1e6
_NS = 1_000_000_000
#: The end of 2037; the next second does not fit into a stamp.
_LATEST_S = 2**31 - 2


def to_stamp(time_s: float) -> Time:
    """The stamp nearest to `time_s` (s, >= 0)."""
    seconds, nanoseconds = divmod(round(time_s * _NS), _NS)
    return Time(sec=int(seconds), nanosec=int(nanoseconds))


def to_header(frame: str, time_s: float) -> Header:
    """The header of a message in a frame, at a time."""
    return Header(frame_id=frame, stamp=to_stamp(time_s))


def stamp_ns(stamp: Time) -> int:
    """The stamp in nanoseconds; MessageError for one that is no time."""
    if stamp.nanosec >= _NS:
        rule = f"stamp must have nanosec below {_NS}"
        raise MessageError(rule, stamp.nanosec, "publish the time in ns")
    return require_time(int(stamp.sec) * _NS + int(stamp.nanosec))


def require_time(time_ns: int) -> int:
    """The time, which must be one that a stamp can have."""
    if not 0 <= time_ns < _LATEST_S * _NS:
        rule, fix = f"stamp must be from 0 to {_LATEST_S} s", "publish the time of the measurement"
        raise MessageError(rule, f"{time_ns / _NS:g} s", fix)
    return time_ns


def stamp_s(stamp: Time) -> float:
    """The stamp in seconds."""
    return stamp_ns(stamp) / _NS


def require_finite(name: str, values: ArrayLike) -> None:
    """Require numbers between -LARGEST and LARGEST."""
    with np.errstate(invalid="ignore"):  # a signalling NaN
        numbers = np.asarray(values, dtype=np.float64)
    sound = np.abs(numbers) <= LARGEST
    if not sound.all():
        rule, wrong = f"{name} must be finite and at most {LARGEST:g}", float(numbers[~sound][0])
        raise MessageError(rule, repr(wrong), "correct what publishes it")


def require_frame(header: Header, *frames: str) -> None:
    """Require one of these frames."""
    if header.frame_id not in frames:
        rule = f"frame_id must be {' or '.join(map(repr, frames))}"
        fix = f"transform it to {frames[0]!r} before it is published"
        raise MessageError(rule, repr(header.frame_id), fix)


def require_one_of(name: str, value: str, choices: Sequence[str]) -> str:
    """The value, which must be one of the choices."""
    if value not in choices:
        known = ", ".join(map(repr, choices))
        raise MessageError(f"{name} must be one of {known}", repr(value), "publish one of them")
    return value


class Jump(Enum):
    """FORWARD: by more than a second, what was received before is stale; BACKWARD: by more than a
    second, a new session begins; LATE: an older message of the same session."""

    NONE, FORWARD, BACKWARD, LATE = "none", "forward", "backward", "late"


class StampClock:
    """The clock that the stamps of one topic show."""

    def __init__(self) -> None:
        self._newest_ns: int | None = None

    def advance(self, time_ns: int) -> Jump:
        """Take the next stamp; how the clock moved to it."""
        step_ns = 0 if self._newest_ns is None else time_ns - self._newest_ns
        if -RESTART_NS <= step_ns < 0:
            return Jump.LATE
        self._newest_ns = time_ns
        if step_ns < 0:
            return Jump.BACKWARD
        return Jump.FORWARD if step_ns > RESTART_NS else Jump.NONE
