"""The one base error of the package."""

from storage.errors import FileError


class BagError(FileError):
    """A bag cannot be written, read or believed; the sentence names it and the fix."""
