"""The one base error of the report package."""

from serd_core.errors import SerdError


class ReportError(SerdError):
    """An input of the report breaks a rule; the message names it and the fix."""
