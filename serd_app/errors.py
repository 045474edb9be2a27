"""The base error of the package."""

from serd_core.errors import SerdError


class AppError(SerdError):
    """The request is not possible; the message names the fix."""


class TeleopError(SerdError):
    """Driving by hand is impossible as requested; the message names the fix."""


class ReportError(SerdError):
    """An input of the report breaks a rule; the message names it and the fix."""
