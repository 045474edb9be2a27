"""Reading files, and writing them whole or not at all."""

import errno
import os
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

from serd_bag.errors import FileError, disk_errors


def read_text(path: str | Path) -> str:
    """The text of the file; FileError where it is missing, unreadable or not UTF-8."""
    try:
        return read_bytes(path).decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise FileError(
            f"{path}: must be UTF-8 text, got byte {error.object[error.start]:#04x}"
            f" at offset {error.start}; give a text file in UTF-8"
        ) from None


def read_bytes(path: str | Path) -> bytes:
    """The content of the file; FileError where it is missing, unreadable or no regular file.

    Devices and pipes are rejected because their content may have no end.
    """
    path = Path(path)
    with disk_errors("read", path):
        mode = path.stat().st_mode
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):  # of a folder the system has the reason
            raise FileError(
                f"{path} must be a regular file, got a device, pipe or socket; write its content to"
                " a file first"
            )
        return path.read_bytes()


def atomic_write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text atomically, see `atomic_write_bytes`."""
    atomic_write_bytes(path, text.encode("utf-8"))


def atomic_write_bytes(path: str | Path, content: bytes) -> None:
    """Write the file; missing folders are made.

    After a crash or power loss the path holds the old content or the new, never a part. On
    FileError (full disk, read-only, ...) the old content is untouched. A symbolic link is followed.
    """
    path = Path(path)
    target = Path(os.path.realpath(path))
    with disk_errors("write", path):
        target.parent.mkdir(parents=True, exist_ok=True)
        _replace(target, content)
        _sync_folder(target.parent)


def require_folder(folder: Path) -> None:
    """FileError where a file stands in the place of the folder, or of one above it, and where they
    may not be written."""
    with disk_errors("write", folder):
        for place in (folder, *folder.parents):
            if place.is_dir():
                if not os.access(place, os.W_OK):
                    raise OSError(errno.EACCES, "")
                return
            if place.exists():
                raise OSError(errno.EEXIST if place == folder else errno.ENOTDIR, "")


def require_file_place(path: Path) -> None:
    """FileError where a file cannot be written: a folder of its name, or no folder for it."""
    require_folder(path.parent)
    with disk_errors("write", path):
        if path.is_dir():
            raise OSError(errno.EISDIR, "")


def delete_file(path: Path) -> None:
    """Delete the file where there is one; FileError where that is not possible."""
    if os.path.lexists(path):  # read-only file systems refuse to delete what is not there, too
        with disk_errors("delete", path):
            path.unlink(missing_ok=True)


def _replace(target: Path, content: bytes) -> None:
    mask = os.umask(0)
    os.umask(mask)
    mode = target.stat().st_mode & 0o777 if target.exists() else 0o666 & ~mask
    descriptor, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name[:100]}.")
    temporary = Path(name)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fchmod(stream.fileno(), mode)
            os.fsync(stream.fileno())
        temporary.replace(target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _sync_folder(folder: Path) -> None:
    """Make the rename itself durable, where the file system can."""
    descriptor = os.open(folder, os.O_RDONLY)
    with suppress(OSError):
        os.fsync(descriptor)
    os.close(descriptor)
