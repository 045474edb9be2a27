"""Files of which some bytes are wrong."""

from pathlib import Path


def write_wrong(path: Path, content: bytes, place: int, wrong: bytes) -> None:
    """Write a file whose bytes from a place on are others; it stays as long as it is."""
    path.write_bytes(content[:place] + wrong + content[place + len(wrong) :])


def write_flipped(path: Path, content: bytes, place: int, bit: int = 0) -> None:
    """Write a file with one bit of one byte flipped."""
    write_wrong(path, content, place, bytes([content[place] ^ 1 << bit]))
