"""The one base error of the report package."""

from serd_core.errors import SerdError


class ReportError(SerdError):
    """An input of the report breaks a rule; the sentence names it and says what to do."""
