"""Where a command may write, found out before it works for minutes."""

import errno
from pathlib import Path

from storage.errors import disk_error


def require_folder(folder: Path) -> None:
    """FileError where a file stands in the place of the folder, or of one above it."""
    for place in (folder, *folder.parents):
        if place.is_dir():
            return
        if place.exists():
            in_the_way = errno.EEXIST if place == folder else errno.ENOTDIR
            raise disk_error("write", folder, OSError(in_the_way, ""))


def require_file_place(path: Path) -> None:
    """FileError where a file cannot be written: a folder of its name, or no folder for it."""
    require_folder(path.parent)
    if path.is_dir():
        raise disk_error("write", path, OSError(errno.EISDIR, ""))
