"""The one base error of the package."""

from serd_core.errors import SerdError


class SimError(SerdError):
    """An input of the simulation breaks a rule."""
