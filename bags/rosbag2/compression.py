"""zstd as rosbag2 uses it outside MCAP: whole storage files, or single messages."""

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

import zstandard

from bags.damage import Damage
from bags.errors import BagError
from bags.rosbag2.layout import COMPRESSED_FILE
from storage.errors import disk_error

#: A compressed message begins with these bytes, an uncompressed CDR message with a zero.
COMPRESSED_MESSAGE = zstandard.FRAME_HEADER


def decompressed(data: bytes) -> bytes | None:
    """The content of one compressed message, None where it is damaged."""
    decompressor = zstandard.ZstdDecompressor().decompressobj()
    try:
        content = decompressor.decompress(data)
    except zstandard.ZstdError:
        return None
    return content if decompressor.eof else None


class DecompressedFiles:
    """paths: what to read in place of each file; damage: of files that decompress only in part.

    `close` removes the decompressed copies.
    """

    def __init__(self, files: Sequence[Path]) -> None:
        self.damage: list[Damage] = []
        self._folder: Path | None = None
        self.paths = tuple(self._path(number, file) for number, file in enumerate(files))

    def close(self) -> None:
        """Remove the decompressed files; further calls do nothing."""
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)

    def _path(self, number: int, file: Path) -> Path:
        if file.suffix != COMPRESSED_FILE:
            return file
        if self._folder is None:
            self._folder = Path(tempfile.mkdtemp(prefix="serd-bag-"))
        target = self._folder / f"{number}_{file.stem}"
        try:
            self._decompress(file, target)
        except OSError as error:
            self.close()
            raise BagError(str(disk_error("unpack", file, error))) from None
        return target

    def _decompress(self, file: Path, target: Path) -> None:
        """Write as much of the content as can be decompressed."""
        with file.open("rb") as source, target.open("wb") as copy:
            decompressor = zstandard.ZstdDecompressor().decompressobj()
            try:
                while block := source.read(1 << 20):
                    copy.write(decompressor.decompress(block))
            except zstandard.ZstdError as error:
                self.damage.append(Damage(file, None, f"it cannot be unpacked ({error})"))
                return
        if not decompressor.eof:
            self.damage.append(Damage(file, None, "the compressed file is cut off"))
