"""What has come in but was not looked at yet when a node is told to stop."""

from collections.abc import Iterator

from rclpy.subscription import Subscription


def waiting_messages(subscription: Subscription) -> Iterator[bytes]:
    """The raw messages that still wait; works until the node is destroyed, also after a signal."""
    while (found := subscription.handle.take_message(subscription.msg_type, True)) is not None:
        yield bytes(found[0])
