"""Files of which some bytes are wrong."""

from pathlib import Path

from serd_bag.health.check import BagCheck
from serd_bag.health.contents import BagContents
from serd_bag.rescue.certificate import Certificate


def write_wrong(path: Path, content: bytes, place: int, wrong: bytes) -> None:
    """Write a file whose bytes from a place on are others; it stays as long as it is."""
    path.write_bytes(content[:place] + wrong + content[place + len(wrong) :])


def write_flipped(path: Path, content: bytes, place: int, bit: int = 0) -> None:
    """Write a file with one bit of one byte flipped."""
    write_wrong(path, content, place, bytes([content[place] ^ 1 << bit]))


def wrong_numbers(content: bytes, starts: list[int], right: int, n_bytes: int = 8) -> list[int]:
    """Places of all kinds in a file whose records begin there, and numbers near the right one."""
    values = {0, 8, starts[1] + 20, starts[2], starts[-2], starts[-1], len(content)}
    values |= {len(content) + 1000, right + 1, right - 1, 2 ** (8 * n_bytes) - 1}
    return sorted({value % 256**n_bytes for value in values if value >= 0} - {right})


def counts_of(found: BagCheck | BagContents | Certificate) -> dict[str, int]:
    """Messages by topic."""
    if isinstance(found, Certificate):
        return {topic.name: topic.n_saved for topic in found.topics}
    return {topic.name: topic.n_messages for topic in found.topics}
