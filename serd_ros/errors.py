"""The package's errors."""

from serd_core.errors import SerdError


class NodeError(SerdError):
    """A node cannot start or go on; the sentence states the fix."""


class MessageError(NodeError):
    """A received message breaks a rule and is dropped; rule: the constant part of the sentence."""

    def __init__(self, rule: str, received: object, fix: str) -> None:
        super().__init__(f"{rule}, got {received}; {fix}")
        self.rule = rule
