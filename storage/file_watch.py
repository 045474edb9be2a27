"""Whether a file has been replaced or written since it was last looked at."""

from pathlib import Path

Mark = tuple[int, int, int]


class FileWatch:
    """Compares inode, size and time of writing; a missing file counts as unchanged."""

    def __init__(self, path: str | Path) -> None:
        self._path = Path(path)
        self._mark = self._look()

    def changed(self) -> bool:
        """Whether it is another file than at the last call, or than at the beginning."""
        mark = self._look()
        if mark is None or mark == self._mark:
            return False
        self._mark = mark
        return True

    def _look(self) -> Mark | None:
        try:
            status = self._path.stat()
        except OSError:
            return None
        return status.st_ino, status.st_size, status.st_mtime_ns
