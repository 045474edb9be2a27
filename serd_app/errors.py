"""The base error of the package."""

from serd_core.errors import SerdError


class AppError(SerdError):
    """What was asked for is not possible; the message says what to do."""
