"""Storage files of a bag as they are read: those compressed as a whole are unpacked first."""

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

import zstandard

from bags.errors import BagError
from bags.health.damage import Damage
from storage.errors import disk_error

PACKED = ".zstd"


class UnpackedFiles:
    """paths: what to read in place of each file; damage: of files that unpack only in part.

    `close` removes what was unpacked.
    """

    def __init__(self, files: Sequence[Path]) -> None:
        self.damage: list[Damage] = []
        self._folder: Path | None = None
        self.paths = tuple(self._path(number, file) for number, file in enumerate(files))

    def close(self) -> None:
        """Remove the unpacked files; a second time does nothing."""
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)

    def _path(self, number: int, file: Path) -> Path:
        if file.suffix != PACKED:
            return file
        if self._folder is None:
            self._folder = Path(tempfile.mkdtemp(prefix="serd-bag-"))
        unpacked = self._folder / f"{number}_{file.stem}"
        try:
            self._unpack(file, unpacked)
        except OSError as error:
            self.close()
            raise BagError(str(disk_error("unpack", file, error))) from None
        return unpacked

    def _unpack(self, file: Path, unpacked: Path) -> None:
        """As much as can be unpacked."""
        with file.open("rb") as source, unpacked.open("wb") as target:
            unpacker = zstandard.ZstdDecompressor().decompressobj()
            try:
                while block := source.read(1 << 20):
                    target.write(unpacker.decompress(block))
            except zstandard.ZstdError as error:
                self.damage.append(Damage(file, None, f"it cannot be unpacked ({error})"))
                return
        if not unpacker.eof:
            self.damage.append(Damage(file, None, "the compressed file is cut off"))
