"""Start a node, spin it until it is done or a signal stops it, and end with an exit code."""

import math
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from types import FrameType
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions

from serd_files.errors import USER_ERRORS
from serd_ros.endpoints.endpoints import confirm
from serd_ros.process.exit_limit import process_ends_within
from serd_ros.process.serd_node import BAD_INPUT, INTERNAL_ERROR, SerdNode

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
        with process_ends_within(exit_code):
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

    Its `spin` keeps a core busy in these wheels; waiting for a future, turn by turn, does not.
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
            executor.spin_until_future_complete(node.finished, timeout_sec=_TURN_S)
            end_if_due(_TURN_S)
    finally:
        executor.remove_node(node)
        executor.shutdown()
    return int(node.finished.result()) if node.finished.done() else 0
