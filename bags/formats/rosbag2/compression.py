"""zstd as rosbag2 uses it outside MCAP: whole storage files, or single messages."""

import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import zstandard

from bags.damage import Damage
from bags.errors import BagError
from bags.formats.limits import LARGEST_CONTENT, most_unpacked
from bags.formats.rosbag2.layout import COMPRESSED_FILE
from bags.topic import RawMessage
from storage.errors import disk_errors

#: Bytes of which zstd makes 32 MiB at most.
_PIECE = 1024
#: A compressed message begins with these bytes, an uncompressed CDR message with a zero.
_COMPRESSED = zstandard.FRAME_HEADER


class Decompression:
    """Decompresses messages that are; n_broken: those so far that cannot be."""

    n_broken = 0

    def messages(self, recorded: Iterable[RawMessage]) -> Iterator[RawMessage]:
        """Those that are sound, each with its content."""
        for message in recorded:
            if message.data.startswith(_COMPRESSED):
                data = _decompressed(message.data)
                if data is None:
                    self.n_broken += 1
                    continue
                message = message._replace(data=data)
            yield message


def _decompressed(data: bytes) -> bytes | None:
    """The content of one compressed message, None where it is damaged."""
    try:
        if zstandard.frame_content_size(data) > LARGEST_CONTENT:
            return None
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=LARGEST_CONTENT)
    except (zstandard.ZstdError, MemoryError):
        return None


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
            with disk_errors("unpack", file, BagError):
                self._decompress(file, target)
        except BagError:
            self.close()
            raise
        return target

    def _decompress(self, file: Path, target: Path) -> None:
        """Write as much of the content as can be decompressed and a file of its size may hold."""
        left = most_unpacked(file.stat().st_size)
        with file.open("rb") as source, target.open("wb") as copy:
            decompressor = zstandard.ZstdDecompressor().decompressobj()
            try:
                while (piece := source.read(_PIECE)) and left > 0:
                    left -= copy.write(decompressor.decompress(piece)[:left])
            except zstandard.ZstdError as error:
                self.damage.append(Damage(file, None, f"it cannot be unpacked ({error})"))
                return
        if left <= 0:
            what = "it unpacks to more than a file of its size can hold; the rest is not read"
            self.damage.append(Damage(file, None, what))
        elif not decompressor.eof:
            self.damage.append(Damage(file, None, "the compressed file is cut off"))
