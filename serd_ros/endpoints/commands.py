"""Velocity commands, as Twist or TwistStamped.

A node that was stopped finds the commands that waited for it. By the time of their arrival they
would be new, so the time counts at which the middleware sent them, and only the newest one waits.
"""

import time
from collections.abc import Callable, Mapping
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped

from serd_ros.convert.command import to_twist, to_twist_stamped
from serd_ros.endpoints import qos
from serd_ros.endpoints.endpoints import Endpoints
from serd_ros.errors import MessageError
from serd_sim.world.command import Command

#: Clocks of machines may differ by this much.
_CLOCKS_AGREE_S = 0.2


class CommandPublisher:
    """Publishes commands of a robot."""

    def __init__(self, endpoints: Endpoints, topic: str, *, stamped: bool) -> None:
        self._frames, self._stamped = endpoints.node.frames, stamped
        self._publisher = endpoints.publisher(_kind(stamped), topic, qos.STATE)

    def publish(self, command: Command, time_s: float) -> None:
        """Send a command. time_s: of the observation that it answers."""
        if self._stamped:
            message = self._frames.prefixed(to_twist_stamped(command, time_s))
            self._publisher.publish(message)
        else:
            self._publisher.publish(to_twist(command))


def follow_commands(
    endpoints: Endpoints, topic: str, take: Callable[[Any, float], None], *, stamped: bool
) -> None:
    """Call back with each command and its age (s) by the clocks of its publisher and this machine.

    The age is 0 where the middleware does not state when a message was sent. A command that was
    sent in the future is dropped with a MessageError, since its age is unknown.
    """

    def take_sent(message: Any, info: Mapping[str, int]) -> None:
        sent_ns = info["source_timestamp"]
        age_s = (time.time_ns() - sent_ns) * 1e-9 if sent_ns > 0 else 0.0
        if age_s < -_CLOCKS_AGREE_S:
            raise MessageError(
                f"commands must be sent at most {_CLOCKS_AGREE_S:g} s in the future",
                f"{-age_s:.1f} s",
                "set the clocks of the machines",
            )
        take(message, max(age_s, 0.0))

    endpoints.subscribe(_kind(stamped), topic, take_sent, qos.NEWEST)


def _kind(stamped: bool) -> type[Twist | TwistStamped]:
    return TwistStamped if stamped else Twist
