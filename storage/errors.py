"""The one base error of the package and the sentences for what a disk can refuse."""

import errno
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


class FileError(SerdError):
    """A file cannot be read, written or believed; the sentence names it and the fix."""


def disk_error(doing: str, path: Path, error: OSError) -> FileError:
    """FileError that says why the operating system refused `doing` ("read", "write") the path."""
    unknown = (error.strerror or str(error), "check the path and the disk")
    reason, fix = _REASON_AND_FIX.get(error.errno or 0, unknown)
    return FileError(f"cannot {doing} {path}: {reason}; {fix}")
