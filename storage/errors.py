"""The base error of the package and the parts of its messages."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from serd_core.errors import SerdError

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


class FileError(SerdError):
    """A file cannot be read or written, or is invalid; the message names it and the fix."""


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
