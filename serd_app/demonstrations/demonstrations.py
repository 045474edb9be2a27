"""What is learned from: decisions, and when each demonstration entered the goal area."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from bags.errors import BagError
from serd_app.demonstrations.concatenate import joined_decisions
from serd_app.demonstrations.discretise import (
    DiscretisationReport,
    decisions_from_drive,
    joined_reports,
)
from serd_app.demonstrations.goal_entry import goal_entries_s
from serd_app.drives.recorded_drive import RecordedDrive
from serd_app.drives.sessions import read_drives
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.grid import Grid


@dataclass(frozen=True, eq=False)
class Demonstrations:
    """Decisions, and when within their last periods the demonstrations were in the goal area."""

    decisions: Decisions
    goal_entry_s: tuple[float, ...] = ()

    @cached_property
    def episode_rows(self) -> dict[int, bytes]:
        """Every decision of each episode as bytes, to tell repeated episodes by."""
        table = self.decisions
        columns = (table.time_s, table.state, table.action, table.next_state)
        return {
            int(episode): b"".join(column[table.episode == episode].tobytes() for column in columns)
            for episode in table.episodes
        }

    def joined(self, later: "Demonstrations") -> "Demonstrations":
        """Both; the later episodes are numbered on."""
        return Demonstrations(
            joined_decisions([self.decisions, later.decisions]),
            self.goal_entry_s + later.goal_entry_s,
        )


def demonstrations_of_bag(
    bag: str | Path,
    grid: Grid,
    decision_period_s: float,
    *,
    tolerant: bool = False,
    seen: set[bytes] | None = None,
) -> tuple[Demonstrations, DiscretisationReport]:
    """Those of a bag, and what became of every intent; BagError where there is nothing to use.

    tolerant: use what a broken bag still holds. seen: see `fresh_from_drive`.
    """
    drives = read_drives(bag, tolerant=tolerant)
    found, report = demonstrations_of_drives(drives, grid, decision_period_s, seen=seen)
    if not len(found.decisions):
        raise BagError(f"bag {bag} holds no decision to learn from: {report}; record more")
    return found, report


def demonstrations_of_drives(
    drives: Sequence[RecordedDrive],
    grid: Grid,
    decision_period_s: float,
    *,
    seen: set[bytes] | None = None,
) -> tuple[Demonstrations, DiscretisationReport]:
    """Those of all drives of one recording, at least one. seen: see `fresh_from_drive`."""
    seen = set() if seen is None else seen
    found = [fresh_from_drive(drive, grid, decision_period_s, seen) for drive in drives]
    together, *others = (here for here, _ in found)
    for later in others:
        together = together.joined(later)
    return together, joined_reports([report for _, report in found])


def with_drive(
    known: Demonstrations | None, drive: RecordedDrive, grid: Grid, decision_period_s: float
) -> tuple[Demonstrations, DiscretisationReport]:
    """What was known and what the drive adds, and what became of the drive's intents."""
    seen = set(known.episode_rows.values()) if known is not None else set()
    here, report = fresh_from_drive(drive, grid, decision_period_s, seen)
    return (here if known is None else known.joined(here)), report


def fresh_from_drive(
    drive: RecordedDrive, grid: Grid, decision_period_s: float, seen: set[bytes]
) -> tuple[Demonstrations, DiscretisationReport]:
    """What the drive adds to the episodes seen, to which its own are added.

    An episode that was seen already in every decision counts once.
    """
    decisions, report = decisions_from_drive(drive, grid, decision_period_s)
    rows = Demonstrations(decisions).episode_rows
    fresh = [episode for episode, row in rows.items() if row not in seen]
    seen.update(rows.values())
    decisions = decisions.select(np.isin(decisions.episode, fresh))
    entry_s = goal_entries_s(drive.episodes, decisions, decision_period_s)
    return Demonstrations(decisions, tuple(entry_s.tolist())), report.without_repeated(decisions)
