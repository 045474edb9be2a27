"""Settings of the recorder, without the libraries of messages that it loads."""

from dataclasses import dataclass
from typing import Literal

from serd_bag.errors import BagError

_LONGEST_FLUSH_S = 0.5


@dataclass(frozen=True)
class RecorderSettings:
    """min_free_bytes: recording ends while this much of the disk is still free."""

    max_file_bytes: int | None = None
    compression: Literal["none", "zstd"] = "none"
    flush_period_s: float = 0.25
    sync: bool = True
    min_free_bytes: int = 100_000_000

    def __post_init__(self) -> None:
        if not 0 < self.flush_period_s <= _LONGEST_FLUSH_S:
            raise BagError(
                f"flush_period_s must be above 0 and at most {_LONGEST_FLUSH_S}, got"
                f" {self.flush_period_s}"
            )
        if self.max_file_bytes is not None and self.max_file_bytes <= 0:
            raise BagError(f"max_file_bytes must be above 0 or None, got {self.max_file_bytes}")
        if self.min_free_bytes < 0:
            raise BagError(f"min_free_bytes must be at least 0, got {self.min_free_bytes}")
