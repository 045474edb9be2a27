"""The base error of the package."""

from serd_core.errors import SerdError


class AppError(SerdError):
    """The request is not possible; the message names the fix."""
