"""How a run was made: command, seeds, versions, phases and the files lying beside the report."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import PurePosixPath

from report.checks import finite_number
from report.errors import ReportError


@dataclass(frozen=True)
class PhaseTiming:
    """Wall-clock time of one phase, and the simulated time it covered if it simulated anything."""

    name: str
    wall_s: float
    simulated_s: float | None = None

    def __post_init__(self) -> None:
        finite_number(f"wall_s of the phase {self.name!r}", self.wall_s)
        if self.simulated_s is not None:
            finite_number(f"simulated_s of the phase {self.name!r}", self.simulated_s)

    @property
    def real_time_factor(self) -> float | None:
        """Simulated seconds per second of the wall clock."""
        if self.simulated_s is None or self.wall_s <= 0:
            return None
        return self.simulated_s / self.wall_s


@dataclass(frozen=True)
class FileLink:
    """A file or folder beside the report; `path` is relative to the report's folder."""

    path: str
    what: str

    def __post_init__(self) -> None:
        pure = PurePosixPath(self.path)
        if not self.path or pure.is_absolute() or ".." in pure.parts or ":" in self.path:
            raise ReportError(
                f"path of a file link must be relative to the report and below it, "
                f"got {self.path!r}; put the file beside the report"
            )


@dataclass(frozen=True)
class RunFacts:
    """What a reader needs to make the same run again; `finished_at` is ISO 8601."""

    command: str
    how: str
    finished_at: str
    phases: tuple[PhaseTiming, ...] = ()
    seeds: Mapping[str, int] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
