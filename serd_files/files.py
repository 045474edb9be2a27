"""Whether files are the same, and whether they have changed."""

from collections.abc import Iterable
from os.path import realpath
from pathlib import Path


def shared_file(written: Iterable[Path], others: Iterable[str | Path]) -> Path | None:
    """The first of the files that is one of the others, by whatever links; None where none is."""
    known = {realpath(each) for each in others}  # which takes links that go round
    return next((path for path in written if realpath(path) in known), None)


Mark = tuple[int, int, int]


class FileWatch:
    """Compares inode, size and time of writing; a missing file counts as unchanged."""

    def __init__(self, path: str | Path) -> None:
        self._path = Path(path)
        self._mark: Mark | None = None

    def changed(self) -> bool:
        """Whether it is another file than at the last call; at the first, whether there is one."""
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
