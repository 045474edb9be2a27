"""Commands without a stamp, whose age is that since their publisher sent them.

A node that was stopped finds the commands that waited for it. By the time of their arrival they
would be new, so the time counts at which the middleware sent them, and only the newest one waits.
"""

import inspect
import time
from collections.abc import Callable, Mapping
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped

from serd_ros.endpoints import qos
from serd_ros.errors import MessageError
from serd_ros.process.serd_node import SerdNode

#: Clocks of machines may differ by this much.
_CLOCKS_AGREE_S = 0.2


def follow_commands(
    node: SerdNode[Any],
    kind: type[Twist | TwistStamped],
    topic: str,
    take: Callable[[Any, float], None],
) -> None:
    """Call back with each command and its age (s) by the clocks of its publisher and this machine.

    The age is 0 where the middleware does not state when a message was sent. A command that was
    sent in the future is dropped with a MessageError, since its age is unknown.
    """

    def callback(*arguments: Any) -> None:
        """EventsExecutor passes message and info as one tuple, other executors as two."""
        message, info = arguments if len(arguments) == 2 else arguments[0]
        age = age_s(info)
        if age < -_CLOCKS_AGREE_S:
            raise MessageError(
                f"commands must be sent at most {_CLOCKS_AGREE_S:g} s in the future",
                f"{-age:.1f} s",
                "set the clocks of the machines",
            )
        take(message, max(age, 0.0))

    # rclpy delivers the info where the signature has two parameters.
    callback.__signature__ = inspect.signature(take)  # type: ignore[attr-defined]
    node.create_subscription(kind, topic, callback, qos.NEWEST)


def age_s(info: Mapping[str, int]) -> float:
    """Time (s) since a message was sent, by its info; 0 where that is not stated."""
    sent_ns = info["source_timestamp"]
    return (time.time_ns() - sent_ns) * 1e-9 if sent_ns > 0 else 0.0
