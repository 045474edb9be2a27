"""What is wrong with a bag's files."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Damage:
    """offset: byte at which the reader noticed, None where it concerns the whole file."""

    path: Path
    offset: int | None
    what: str

    def sentence(self) -> str:
        """The damage for people to read."""
        where = "" if self.offset is None else f"at byte {self.offset}: "
        return f"{self.path}: {where}{self.what}"
