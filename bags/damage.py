"""What is wrong with a bag's files."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Damage:
    """offset: byte at which the reader noticed; lost_messages: None where nobody can know."""

    path: Path
    offset: int
    what: str
    lost_messages: int | None = None

    def sentence(self) -> str:
        """The damage for people to read."""
        return f"{self.path}: at byte {self.offset}: {self.what}"
