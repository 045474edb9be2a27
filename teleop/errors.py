"""The package's error."""

from serd_core.errors import SerdError


class TeleopError(SerdError):
    """Somebody cannot drive; the sentence says what to do."""
