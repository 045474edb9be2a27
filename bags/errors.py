"""The one base error of the package."""

from storage.errors import FileError


class BagError(FileError):
    """A bag cannot be written or read, or is damaged; the message names it and the fix."""
