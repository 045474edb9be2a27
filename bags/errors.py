"""The base error of the package, and that of damage."""

from storage.errors import FileError


class BagError(FileError):
    """A bag cannot be written or read, or is damaged; the message names it and the fix."""


class DamagedBagError(BagError):
    """A bag is damaged; the message names the command that recovers it, or what else may."""
