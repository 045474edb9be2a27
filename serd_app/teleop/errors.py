"""The base error of the package."""

from serd_core.errors import SerdError


class TeleopError(SerdError):
    """Driving by hand is impossible as requested; the message names the fix."""
