"""Start a node, spin it until it is done or told to stop, and end with an exit code."""

import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions

from serd_core.errors import SerdError
from serd_ros.process.parent_watch import Starter
from serd_ros.process.serd_node import BAD_INPUT, SerdNode

_STOPPING = (signal.SIGINT, signal.SIGTERM)
#: How long (s) a signal may wait for an idle node.
_TURN_S = 0.2
_QUOTES = "put a value that holds : into quotes, as topics:=[odom, '/imu:sensor_msgs/msg/Imu']"


def run_node(make_node: Callable[[], SerdNode[Any]]) -> int:
    """Exit code: the node's own, 0 when told to stop, 2 when it cannot start or go on."""
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        print(f"serd_ros: {_refusal(error)}", file=sys.stderr, flush=True)
        return BAD_INPUT
    told = _ToldToStop()
    node: SerdNode[Any] | None = None
    try:
        node = make_node()
        told.finishes(node)
        return _spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    except SerdError as error:
        name = node.get_name() if node is not None else "serd_ros"
        print(f"{name}: {error}", file=sys.stderr, flush=True)
        return BAD_INPUT
    except Exception:
        # Told to stop while still starting, rcl complains of its closed context: no fault of ours.
        if rclpy.ok():
            raise
        return 0
    finally:
        try:
            if node is not None:
                node.close()
                node.destroy_node()
        finally:
            rclpy.try_shutdown()


def _refusal(error: RuntimeError) -> str:
    """What rcl says of its arguments, without places in its source, and what to do."""
    said = str(error).split(", at /")[0].replace("\n", " ")
    fix = _QUOTES if "parameter override" in said else "correct what follows --ros-args"
    return f"{said}; {fix}"


class _ToldToStop:
    """At SIGINT or SIGTERM the node ends between two callbacks, or once it is made; at a second one
    wherever it is.

    rclpy's own handlers close the context at once, and a callback that is about to publish fails.
    """

    def __init__(self) -> None:
        self._told = False
        self._node: SerdNode[Any] | None = None
        for number in _STOPPING:
            signal.signal(number, self._hear)

    def finishes(self, node: SerdNode[Any]) -> None:
        """It is this node that ends."""
        self._node = node
        if self._told:
            node.finish()

    def _hear(self, _: int, __: FrameType | None) -> None:
        for number in _STOPPING:
            signal.signal(number, signal.default_int_handler)
        self._told = True
        if self._node is not None:
            self._node.finish()


def _spin(node: SerdNode[Any]) -> int:
    """Spin with the events executor, the fastest here.

    Its `spin` keeps a core busy in these wheels; waiting for a future, turn by turn, does not.
    """
    executor = EventsExecutor()
    executor.add_node(node)
    starter = Starter()
    try:
        while rclpy.ok() and not node.finished.done():
            executor.spin_until_future_complete(node.finished, timeout_sec=_TURN_S)
            if starter.gone:
                node.fail("the command that started it was killed; start it again")
    finally:
        starter.close()
        executor.remove_node(node)
        executor.shutdown()
    return int(node.finished.result()) if node.finished.done() else 0
