"""Simulated time in seconds to and from builtin_interfaces/Time.

Exact to the nanosecond for a month of simulated time; beyond, seconds as a double are not.
"""

from builtin_interfaces.msg import Time

from serd_ros.errors import MessageError

_NS = 1_000_000_000


def to_stamp(time_s: float) -> Time:
    """The stamp nearest to `time_s` (s, >= 0)."""
    seconds, nanoseconds = divmod(round(time_s * _NS), _NS)
    return Time(sec=int(seconds), nanosec=int(nanoseconds))


def stamp_ns(stamp: Time) -> int:
    """The stamp in nanoseconds; MessageError for one that is no time."""
    if stamp.sec < 0 or stamp.nanosec >= _NS:
        raise MessageError(
            "stamp must have sec >= 0 and nanosec < 1000000000",
            f"sec {stamp.sec}, nanosec {stamp.nanosec}",
            "publish the time of the measurement",
        )
    return int(stamp.sec) * _NS + int(stamp.nanosec)


def stamp_s(stamp: Time) -> float:
    """The stamp in seconds."""
    return stamp_ns(stamp) / _NS
