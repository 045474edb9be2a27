"""Start a node, spin it until it is done or a signal stops it, and end with an exit code."""

import ctypes
import math
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from types import FrameType
from typing import Any

import rclpy
from rclpy.exceptions import InvalidHandle
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions

from serd_files.errors import USER_ERRORS
from serd_ros.process.lifecycle import bring_up
from serd_ros.process.serd_node import BAD_INPUT, INTERNAL_ERROR, SerdNode, confirm

_STOPPING = (signal.SIGINT, signal.SIGTERM)
#: A signal ends an idle node after one to two of these times (s).
_TURN_S = 0.1
#: A node that lags behind takes what it has received before, for this time (s) at most.
_BACKLOG_S = 0.5
_QUOTES = "put a value that contains : into quotes, as topics:=[odom, '/imu:sensor_msgs/msg/Imu']"


def run_node(make_node: Callable[[], SerdNode[Any]]) -> int:
    """Exit code: the node's own, 0 after a signal, 1 after internal errors, 2 for bad input."""
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # rcl's message about its arguments, with places in its source
        reason = str(error).split(", at /")[0].replace("\n", " ")
        fix = _QUOTES if "parameter override" in reason else "correct what follows --ros-args"
        print(f"serd_ros: {reason}; {fix}", file=sys.stderr, flush=True)
        return BAD_INPUT
    stop = _StopSignal()
    node: SerdNode[Any] | None = None
    exit_code = INTERNAL_ERROR
    try:
        node = make_node()
        bring_up(node)
        exit_code = _spin(node, stop)
        if not exit_code and (n_errors := node.callbacks.n_internal_errors):
            print(f"{node.get_name()}: {n_errors} internal errors, logged above", file=sys.stderr)
            exit_code = INTERNAL_ERROR
    except (KeyboardInterrupt, ExternalShutdownException):
        exit_code = 0
    except USER_ERRORS as error:
        name = node.get_name() if node is not None else "serd_ros"
        print(f"{name}: {error}", file=sys.stderr, flush=True)
        exit_code = BAD_INPUT
    except Exception:
        # A signal during the start closes the context, and rcl raises; that is no error.
        if rclpy.ok():
            raise
        exit_code = 0
    finally:
        _end(node, exit_code)
    return exit_code


def _end(node: SerdNode[Any] | None, exit_code: int) -> None:
    """Release what the node holds, then destroy it."""
    try:
        if node is not None:
            node.close()
            if rclpy.ok():
                confirm(node.publishers)
    finally:
        with suppress(OSError):  # who reads it may have ended
            sys.stdout.flush()
        with _process_ends_in_time(exit_code):
            if node is not None:
                node.destroy_node()
            rclpy.try_shutdown()


class _StopSignal:
    """Notes the time of the first SIGINT, SIGTERM or SIGHUP; a second one interrupts at once.

    The handler only sets a flag, since it may interrupt code that holds a lock: completing a future
    here would block for ever where the executor holds the future's lock. rclpy's own handlers close
    the context at once, and a callback that is about to publish fails.
    """

    def __init__(self) -> None:
        self.received_s = math.inf
        # nohup ignores SIGHUP, and that stays.
        self._numbers = [*_STOPPING]
        if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
            self._numbers.append(signal.SIGHUP)
        for number in self._numbers:
            signal.signal(number, self._receive)

    def _receive(self, _: int, __: FrameType | None) -> None:
        for number in self._numbers:
            signal.signal(number, signal.default_int_handler)
        self.received_s = time.monotonic()


def _spin(node: SerdNode[Any], stop: _StopSignal) -> int:
    """Spin with the events executor, the fastest here, until the node is done or a signal came.

    Its `spin` keeps a core busy (in the Python packages of Jazzy that SERD installs); waiting for a
    future, turn by turn, does not.
    """
    executor = EventsExecutor()
    executor.add_node(node)

    def end_if_due(after_s: float) -> None:
        if time.monotonic() - stop.received_s >= after_s:
            node.finish()

    node.callbacks.after_each = partial(end_if_due, _BACKLOG_S)
    end_if_due(0.0)
    try:
        while rclpy.ok() and not node.finished.done():
            # It returns when no message is left; what is under way arrives in a turn.
            _turn(executor, node)
            end_if_due(_TURN_S)
    finally:
        executor.remove_node(node)
        executor.shutdown()
    return int(node.finished.result()) if node.finished.done() else 0


def _turn(executor: Any, node: SerdNode[Any]) -> None:
    """Spin for a while. Our callbacks raise nothing; what rclpy raises beside them ends no node.

    That is above all an answer that cannot be sent: its client is gone, or its service was
    destroyed while the request waited.
    """
    try:
        executor.spin_until_future_complete(node.finished, timeout_sec=_TURN_S)
    except InvalidHandle:
        pass
    except ExternalShutdownException:
        raise
    except Exception as error:
        node.callbacks.note("executor", executor, error)


#: Fast DDS 2.14 may never return from destroying a node: `DomainParticipant::set_listener` waits
#: for callbacks of discovery with the lock for which these wait. Python's lock is held meanwhile:
#: no thread and no signal handler of Python can act, a timer of the system can.
#: Nodes are destroyed within this time (s), else the process ends without.
_DESTROYED_WITHIN_S = 3
_CLOCK_MONOTONIC, _SIGEV_THREAD = 1, 2


class _Sigevent(ctypes.Structure):
    """`struct sigevent` of glibc: function(value) is called in a thread of its own."""

    _fields_ = [
        ("value", ctypes.c_int64), ("signal", ctypes.c_int), ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p), ("attributes", ctypes.c_void_p),
        ("padding", ctypes.c_byte * 32),
    ]  # fmt: skip


@contextmanager
def _process_ends_in_time(exit_code: int) -> Iterator[None]:
    """End the process with this code where what is done inside takes longer; nothing is flushed."""
    libc = ctypes.CDLL(None)
    end = ctypes.cast(libc._exit, ctypes.c_void_p)
    event = _Sigevent(value=exit_code, notify=_SIGEV_THREAD, function=end)
    timer = ctypes.c_void_p()
    # `struct itimerspec`: period and time until the timer expires, in s and ns each.
    at = (ctypes.c_long * 4)(0, 0, _DESTROYED_WITHIN_S, 0)
    armed = not libc.timer_create(_CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer))
    armed = armed and not libc.timer_settime(timer, 0, ctypes.byref(at), None)
    try:
        yield
    finally:
        if armed:
            libc.timer_delete(timer)
