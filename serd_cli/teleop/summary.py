"""What a session has recorded, counted from its bag."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from serd_app.demonstrations.demonstrations import demonstrations_of_drives
from serd_app.drives.episode_mark import DISCARDED
from serd_app.drives.sessions import read_drives
from serd_core.errors import SerdError
from sim.scenario.grid import grid_of
from sim.scenario.scenario import load_scenario
from storage.quantities import counted


@dataclass(frozen=True)
class SessionSummary:
    """outcomes: of all episodes; n_decisions: of those that were not discarded."""

    outcomes: dict[str, int]
    n_decisions: int

    @property
    def n_kept(self) -> int:
        """Episodes that were not discarded."""
        return sum(self.outcomes.values()) - self.outcomes.get(DISCARDED, 0)

    def __str__(self) -> str:
        """The counts in words."""
        kept = sorted(
            (name.replace("_", " "), n) for name, n in self.outcomes.items() if name != DISCARDED
        )
        how = ", ".join(f"{count} {name}" for name, count in kept)
        return (
            f"{counted(self.n_kept, 'episode')} kept{f' ({how})' if how else ''}, "
            f"{self.outcomes.get(DISCARDED, 0)} discarded; "
            f"{counted(self.n_decisions, 'decision')} by directions"
        )


def summarise_session(bag: Path, scenario: str) -> SessionSummary | None:
    """The bag's episodes and decisions; None where nothing readable was recorded."""
    place = load_scenario(scenario)
    try:
        drives = read_drives(bag, tolerant=True)
        _, report = demonstrations_of_drives(drives, grid_of(place), place.decision_period_s)
    except SerdError:
        return None
    outcomes = Counter(span.outcome for drive in drives for span in drive.episodes)
    return SessionSummary(dict(outcomes), report.n_decisions)
