"""A file that only grows, in whole blocks: what was appended before a failure stays readable."""

import contextlib
import os
from pathlib import Path

from bags.errors import BagError
from storage.errors import disk_error


class DiskFile:
    """Unbuffered, so that a killed process loses nothing it has appended."""

    def __init__(self, path: Path, *, sync: bool = False) -> None:
        self.path = path
        self.size = 0
        self._sync = sync
        try:
            self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        except OSError as error:
            raise BagError(str(disk_error("write", path, error))) from None

    def append(self, block: bytes | bytearray) -> None:
        """Append the block; on BagError (disk full, ...) no part of it stays."""
        try:
            rest = memoryview(block)
            while rest:
                rest = rest[os.write(self._descriptor, rest) :]
            if self._sync:
                os.fdatasync(self._descriptor)
        except OSError as error:
            self._take_back()
            raise BagError(str(disk_error("write", self.path, error))) from None
        self.size += len(block)

    @property
    def is_open(self) -> bool:
        """Whether more can be appended."""
        return self._descriptor >= 0

    def close(self) -> None:
        """Close the file; further calls do nothing."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)

    def _take_back(self) -> None:
        # Where even this fails, the reader finds the last whole block by itself.
        with contextlib.suppress(OSError):
            os.ftruncate(self._descriptor, self.size)
            os.lseek(self._descriptor, self.size, os.SEEK_SET)
