"""A limit on the time in which this process destroys its ROS nodes.

Fast DDS 2.14 may never return from it: `DomainParticipant::set_listener` waits for callbacks of
discovery, until a time that its clock cannot represent, so that the wait returns at once and keeps
the lock for which the callbacks wait. It happens where other nodes come or go at that moment.
Python's lock is held meanwhile: no thread and no signal handler of Python can act, a timer of the
system can.
"""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager

#: Nodes are destroyed within this time, else the process ends without (ms).
_DESTROYED_WITHIN_MS = 3000
_CLOCK_MONOTONIC, _SIGEV_THREAD = 1, 2
_SIGEVENT_BYTES = 64


class _Sigevent(ctypes.Structure):
    """`struct sigevent` of glibc: function(value) is called in a thread of its own."""

    _fields_ = [
        ("value", ctypes.c_int64), ("signal", ctypes.c_int), ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p), ("attributes", ctypes.c_void_p),
        ("padding", ctypes.c_byte * (_SIGEVENT_BYTES - 32)),
    ]  # fmt: skip


class _Itimerspec(ctypes.Structure):
    """`struct itimerspec`: period and time until the timer expires."""

    _fields_ = [(name, ctypes.c_long) for name in ("period_s", "period_ns", "time_s", "time_ns")]


@contextmanager
def process_ends_within(exit_code: int, limit_ms: int = _DESTROYED_WITHIN_MS) -> Iterator[None]:
    """End the process with this code where what is done inside takes longer; nothing is flushed."""
    libc = ctypes.CDLL(None)
    end = ctypes.cast(libc._exit, ctypes.c_void_p)
    event = _Sigevent(value=exit_code, notify=_SIGEV_THREAD, function=end)
    timer, time_s = ctypes.c_void_p(), divmod(limit_ms, 1000)
    at = _Itimerspec(time_s=time_s[0], time_ns=time_s[1] * 1_000_000)
    armed = not libc.timer_create(_CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer))
    armed = armed and not libc.timer_settime(timer, 0, ctypes.byref(at), None)
    try:
        yield
    finally:
        if armed:
            libc.timer_delete(timer)
