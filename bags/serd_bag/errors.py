"""The base errors of files and bags, and the parts of their messages."""

import errno
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_REASON_AND_FIX = {
    errno.ENOSPC: ("the disk is full", "free some space or choose another folder"),
    errno.EDQUOT: ("the disk quota is used up", "free some space or choose another folder"),
    errno.EFBIG: ("the file system allows no file of this size", "choose another folder"),
    errno.EROFS: ("the file system is read-only", "choose a folder you may write to"),
    errno.EACCES: ("permission is denied", "change its permissions or choose another path"),
    errno.EPERM: ("permission is denied", "change its permissions or choose another path"),
    errno.ENOENT: ("it does not exist", "check the path"),
    errno.ENOTDIR: ("a part of the path is a file, not a folder", "check the path"),
    errno.EEXIST: ("a file of this name is in the way", "move it away or choose another path"),
    errno.EISDIR: ("it is a folder", "name a file"),
    errno.ENAMETOOLONG: ("the name is too long", "choose a shorter one"),
    errno.EIO: ("the disk reports an input/output error", "check the disk"),
}
_LONGEST_VALUE = 60


#: Control characters, which a terminal obeys, and those that turn the direction of writing.
_OBEYED = re.compile("[\x00-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


class FileError(ValueError):
    """A file cannot be read or written, or is invalid; the message names it and the fix."""

    def __str__(self) -> str:
        """The message as one line, whatever line ends the value received contains."""
        return printable(" ".join(super().__str__().splitlines()))


class BagError(FileError):
    """A bag cannot be written or read, or is damaged; the message names it and the fix."""


class DamagedBagError(BagError):
    """A bag is damaged; the message names the command that recovers it, or what else may."""


def printable(text: str) -> str:
    """The text with the escapes of characters that a terminal or a YAML comment would not show."""
    return _OBEYED.sub(lambda found: repr(found[0])[1:-1], text)


@contextmanager
def disk_errors(doing: str, path: Path, kind: type[FileError] = FileError) -> Iterator[None]:
    """An OSError within becomes a FileError with the operating system's reason; doing: "read",
    "write", "unpack", "delete" or "use"."""
    try:
        yield
    except OSError as error:
        unknown = (error.strerror or str(error), "check the path and the disk")
        reason, fix = _REASON_AND_FIX.get(error.errno or 0, unknown)
        raise kind(f"cannot {doing} {path}: {reason}; {fix}") from None


def shortened(text: str) -> str:
    """The text, cut to a length that fits into an error message."""
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 1] + "…"
