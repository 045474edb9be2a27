"""The package's error."""

from serd_core.errors import SerdError


class NodeError(SerdError):
    """A node cannot start or go on; the sentence says what to do."""
