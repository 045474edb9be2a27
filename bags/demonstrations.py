"""What is learned from: decisions, and when each demonstration entered the goal area."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from bags.discretise import DiscretisationReport, decisions_from_bag
from bags.goal_entry import goal_entry_times_s
from bags.joined_decisions import joined_decisions
from serd_core.demonstrations import Decisions
from serd_core.grid import Grid


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
    bag: str | Path, grid: Grid, decision_period_s: float
) -> tuple[Demonstrations, DiscretisationReport]:
    """Those of a bag, and what became of every intent; BagError where there is nothing to use."""
    decisions, report = decisions_from_bag(bag, grid, decision_period_s)
    entry_s = goal_entry_times_s(bag, decisions, decision_period_s)
    return Demonstrations(decisions, tuple(entry_s.tolist())), report
