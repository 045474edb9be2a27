"""From a recorded drive to decisions (s, a, s') on a grid.

Every recorded intent inside an episode is one decision: s is the cell of the robot at its stamp, a
the direction it names, s' what the rule of `decision_rule` makes of the place one decision period
later, or at the arrival if that comes first. Nothing is dropped without being counted.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bags.decision_rule import Move, next_state_of
from bags.errors import BagError
from bags.recorded_drive import EpisodeSpan, RecordedDrive, read_drive
from serd_core.arrays import FloatArray
from serd_core.demonstrations import Decisions
from serd_core.grid import Grid

OUTSIDE_EPISODE = "outside any episode"
CUT_SHORT = "cut short by the end of its episode"
NO_POSE = "no pose recorded then"
OFF_GRID = "robot off the grid"
UNEXPLAINED = "no neighbouring cell explains the move"
_LONGEST_GAP_S = 0.5


@dataclass(frozen=True)
class DiscretisationReport:
    """n_decisions kept; of those, diagonal and far moves assigned to a neighbour; dropped: why."""

    n_decisions: int
    n_episodes: int
    n_diagonal: int
    n_far: int
    dropped: dict[str, int] = field(default_factory=dict)

    def __str__(self) -> str:
        """One sentence with every count."""
        dropped = ", ".join(f"{count} {reason}" for reason, count in sorted(self.dropped.items()))
        return (
            f"{self.n_decisions} decisions in {self.n_episodes} episodes; assigned to a neighbour: "
            f"{self.n_diagonal} diagonal and {self.n_far} far moves; dropped: {dropped or 'none'}"
        )


def decisions_from_bag(
    directory: str | Path, grid: Grid, decision_period_s: float
) -> tuple[Decisions, DiscretisationReport]:
    """Decisions of a bag with robot_pose, intent and episode; BagError where one is missing."""
    drive = read_drive(directory)
    decisions, report = decisions_from_drive(drive, grid, decision_period_s)
    if not len(decisions):
        raise BagError(f"bag {directory} holds no decision to learn from: {report}; record more")
    return decisions, report


def decisions_from_drive(
    drive: RecordedDrive, grid: Grid, decision_period_s: float
) -> tuple[Decisions, DiscretisationReport]:
    """Decisions of a recorded drive on a grid, and what became of every intent."""
    rows: list[tuple[int, float, int, int, int]] = []
    moves: Counter[Move] = Counter()
    dropped: Counter[str] = Counter()
    for time_s, action in zip(drive.intent_time_s, drive.intent_action, strict=True):
        episode = _episode_at(drive.episodes, time_s)
        if episode is None:
            dropped[OUTSIDE_EPISODE] += 1
            continue
        outcome = _outcome(drive, grid, episode, float(time_s), decision_period_s)
        if isinstance(outcome, str):
            dropped[outcome] += 1
            continue
        state, next_state, move = outcome
        moves[move] += 1
        rows.append((episode.number, float(time_s), state, int(action), next_state))
    report = DiscretisationReport(
        n_decisions=len(rows),
        n_episodes=len({row[0] for row in rows}),
        n_diagonal=moves[Move.DIAGONAL],
        n_far=moves[Move.FAR],
        dropped=dict(dropped),
    )
    return _table(rows, drive.source), report


def _episode_at(episodes: Sequence[EpisodeSpan], time_s: float) -> EpisodeSpan | None:
    return next((span for span in episodes if span.start_s <= time_s < span.end_s), None)


def _outcome(
    drive: RecordedDrive, grid: Grid, episode: EpisodeSpan, time_s: float, period_s: float
) -> tuple[int, int, Move] | str:
    """(s, s', kind of move) of the period that begins at time_s, or why there is none."""
    end_s = min(time_s + period_s, episode.end_s)
    if end_s < time_s + period_s - 1e-6 and episode.outcome != "arrived":
        return CUT_SHORT
    places = _positions(drive, np.array([time_s, end_s]))
    if places is None:
        return NO_POSE
    state, reached = (int(each) for each in grid.states_at(places))
    if state < 0 or reached < 0:
        return OFF_GRID
    next_state, move = next_state_of(grid, state, reached, places[1])
    return (state, next_state, move) if next_state >= 0 else UNEXPLAINED


def _positions(drive: RecordedDrive, times_s: FloatArray) -> FloatArray | None:
    """(2, 2) places interpolated between recorded poses, None across a gap of them."""
    recorded_s = drive.pose_time_s
    after = np.searchsorted(recorded_s, times_s - 1e-9)
    if (after >= len(recorded_s)).any():
        return None
    before = np.where(np.abs(recorded_s[after] - times_s) < 1e-6, after, after - 1)
    if (before < 0).any() or (recorded_s[after] - recorded_s[before] > _LONGEST_GAP_S).any():
        return None
    columns = [np.interp(times_s, recorded_s, column) for column in drive.position_m.T]
    return np.stack(columns, axis=1)


def _table(rows: Sequence[tuple[int, float, int, int, int]], source: str) -> Decisions:
    columns = np.array(rows, dtype=np.float64).reshape(-1, 5).T
    episode, state, action, next_state = (columns[i].astype(np.int64) for i in (0, 2, 3, 4))
    return Decisions(
        episode=episode,
        time_s=columns[1],
        state=state,
        action=action,
        next_state=next_state,
        source=source,
    )
