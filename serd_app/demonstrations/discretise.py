"""From a recorded drive to decisions (s, a, s') on a grid.

Every recorded intent inside an episode is one decision: s is the cell of the robot at its stamp, a
the direction it names, s' the cell one decision period later, or at the arrival if that is earlier.
Of intents closer together than a decision period the first counts. Every dropped intent is counted.

The grid's dynamics have five outcomes: the own cell and its four neighbours. A robot that ended
elsewhere (diagonally, or more than one cell on) is assigned the neighbour in the direction in which
it moved farthest; where that is no cell, the one in the other direction. Such a decision is a
fault: its progress is not that of the robot. Faults are counted, and so is what no cell explains.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from serd_app.drives.episode_spans import CUT_OFF, DISCARDED, RETURN, EpisodeSpan
from serd_app.drives.recorded_drive import RecordedDrive
from serd_bag.errors import BagError
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.grid import Action, Grid, action_of_direction
from serd_files.yaml_config import StrictModel

OUTSIDE_EPISODE = "outside any episode"
AFTER_CUT_OFF = "after an episode whose end is not recorded"
IN_DISCARDED = "in a discarded episode"
ON_WAY_BACK = "on the way back from the goal"
WITHIN_PERIOD = "within the period of the decision before"
CUT_SHORT = "cut short by the end of its episode"
NO_POSE = "no pose recorded then"
OFF_GRID = "robot off the grid"
UNEXPLAINED = "no neighbouring cell explains the move"
REPEATED = "of an episode that was there before"
#: Share of decisions to wait while the robot moves above which actions do not explain the motion.
MOST_MOVING_WAITS = 0.02
_STAMP_TOLERANCE_S = 1e-6


_Count = Annotated[int, Field(ge=0)]


class DiscretisationReport(StrictModel):
    """n_decisions kept; of those, diagonal and far moves assigned to a neighbour; dropped: why.

    n_bad_poses: poses that were left out because a number in them is not finite.
    n_unplaced_poses: those left out because no transform was recorded about their time.
    n_bad_commands: velocity commands left out because a number in them is not finite.
    n_moving_waits: decisions to wait in whose period the robot moved.
    """

    n_decisions: _Count
    n_episodes: _Count
    n_diagonal: _Count
    n_far: _Count
    dropped: dict[str, int] = Field(default_factory=dict)
    n_bad_poses: _Count = 0
    n_unplaced_poses: _Count = 0
    n_bad_commands: _Count = 0
    n_moving_waits: _Count = 0

    @property
    def n_intents(self) -> int:
        """Recorded intents, each either a decision or dropped."""
        return self.n_decisions + sum(self.dropped.values())

    @property
    def n_moves(self) -> int:
        """Decisions that were made, those that no neighbour explains included."""
        return self.n_decisions + self.dropped.get(UNEXPLAINED, 0)

    @property
    def fault_share(self) -> float:
        """Of the moves, those that no outcome of the grid represents: assigned to a neighbour, or
        dropped."""
        faults = self.n_diagonal + self.n_far + self.dropped.get(UNEXPLAINED, 0)
        return faults / self.n_moves if self.n_moves else 0.0

    @property
    def faults(self) -> str:
        """One sentence about such moves."""
        return (
            f"{100 * self.fault_share:.1f} % of {self.n_moves} moves are no outcome of the grid"
            f" ({self.n_diagonal} diagonal and {self.n_far} far ones count as moves to a"
            f" neighbour, {self.dropped.get(UNEXPLAINED, 0)} are dropped)"
        )

    def __str__(self) -> str:
        """One sentence with every count."""
        dropped = ", ".join(f"{count} {reason}" for reason, count in sorted(self.dropped.items()))
        return (
            f"{self.n_decisions} decisions in {self.n_episodes} episodes; assigned to a neighbour: "
            f"{self.n_diagonal} diagonal and {self.n_far} far moves; dropped: {dropped or 'none'}"
            + (f"; {self.n_bad_poses} poses not finite" if self.n_bad_poses else "")
            + (f"; {self.n_unplaced_poses} poses without /tf" if self.n_unplaced_poses else "")
            + (f"; {self.n_bad_commands} commands not finite" if self.n_bad_commands else "")
            + (f"; {self.n_moving_waits} waits while moving" if self.n_moving_waits else "")
        )


def joined_reports(reports: Sequence[DiscretisationReport]) -> DiscretisationReport:
    """The counts of several drives together."""
    names = DiscretisationReport.model_fields.keys() - {"dropped"}
    return DiscretisationReport(
        dropped=dict(sum((Counter(each.dropped) for each in reports), Counter())),
        **{name: sum(getattr(each, name) for each in reports) for name in names},
    )


class Move(Enum):
    """What kind of move a decision period was."""

    ADJACENT = "own cell or a neighbour"
    DIAGONAL = "diagonal"
    FAR = "more than one cell"


def next_state_of(grid: Grid, state: int, reached: int, end_m: FloatArray) -> tuple[int, Move]:
    """(next state, kind of move) from a cell to the cell that holds end_m (2,); -1 where no
    neighbour explains the move."""
    if reached == state or reached in grid.neighbours[state]:
        return reached, Move.ADJACENT
    steps = np.abs(grid.cells[reached] - grid.cells[state])
    move = Move.DIAGONAL if steps.max() == 1 else Move.FAR
    east, north = end_m - grid.centers_m[state]
    for direction in sorted([(east, 0.0), (0.0, north)], key=lambda d: -abs(d[0] + d[1])):
        action = action_of_direction(*np.sign(direction))
        neighbour = int(grid.neighbours[state, action])
        if action != Action.WAIT and neighbour != state:
            return neighbour, move
    return -1, move


def decisions_from_drive(
    drive: RecordedDrive, grid: Grid, decision_period_s: float, seen: set[bytes] | None = None
) -> tuple[Decisions, DiscretisationReport]:
    """Decisions of a recorded drive on a grid, and what became of every intent.

    seen: `episode_rows` of episodes that are dropped here; those of this drive are added.
    """
    if not decision_period_s > 0:
        raise BagError(f"decision_period_s must be above 0, got {decision_period_s}")
    drops = _DropLog(len(drive.intent_time_s), drive.dropped)
    span = _spans_of(drive, drops, decision_period_s)
    end_s = _ends(drive, span, drops, decision_period_s)
    start_m, start_known = _positions(drive, drive.intent_time_s)
    end_m, end_known = _positions(drive, end_s)
    drops.drop(~(start_known & end_known), NO_POSE)
    state, reached = grid.states_at(start_m), grid.states_at(end_m)
    drops.drop((state < 0) | (reached < 0), OFF_GRID)
    moves = _assign(grid, state, reached, end_m, drops.kept)
    rows = np.flatnonzero(drops.kept & (reached >= 0))
    numbers = np.array([each.number for each in drive.episodes], dtype=np.int64)
    decisions = Decisions(
        episode=numbers[span[rows]],
        time_s=drive.intent_time_s[rows],
        state=state[rows],
        action=drive.intent_action[rows],
        next_state=reached[rows],
        source=drive.source,
    )
    repeated = _repeated(decisions, set() if seen is None else seen)
    drops.drop(np.isin(span, span[rows[repeated]]), REPEATED)
    drops.drop(reached < 0, UNEXPLAINED)
    decisions, kept = decisions.select(~repeated), drops.kept
    moved = np.hypot(*(end_m - start_m)[kept].T) >= drive.minimum_speed_mps * decision_period_s
    kinds = Counter(moves[kept])
    return decisions, DiscretisationReport(
        n_decisions=len(decisions),
        n_episodes=len(decisions.episodes),
        n_diagonal=kinds[Move.DIAGONAL],
        n_far=kinds[Move.FAR],
        dropped=dict(drops.dropped),
        n_bad_poses=drive.n_bad_poses,
        n_unplaced_poses=drive.n_unplaced_poses,
        n_bad_commands=drive.n_bad_commands,
        n_moving_waits=int((moved & (decisions.action == Action.WAIT)).sum()),
    )


def episode_rows(decisions: Decisions) -> dict[int, bytes]:
    """Every decision of each episode as bytes, by which repeated episodes are recognised."""
    columns = (decisions.time_s, decisions.state, decisions.action, decisions.next_state)
    return {
        int(episode): b"".join(column[decisions.episode == episode].tobytes() for column in columns)
        for episode in decisions.episodes
    }


def _repeated(decisions: Decisions, seen: set[bytes]) -> BoolArray:
    """(N,) decisions of episodes that were seen already in every decision; adds the others."""
    rows = episode_rows(decisions)
    repeated = [episode for episode, row in rows.items() if row in seen]
    seen.update(rows.values())
    return np.isin(decisions.episode, repeated)


class _DropLog:
    """Which intents are still decisions, and why the others are not; the first reason counts."""

    def __init__(self, count: int, dropped: Mapping[str, int]) -> None:
        self.kept: BoolArray = np.ones(count, dtype=bool)
        self.dropped: Counter[str] = Counter(dropped)

    def drop(self, rows: BoolArray, reason: str) -> None:
        """Drop those of the rows that are not dropped yet."""
        count = int(np.count_nonzero(self.kept & rows))
        if count:
            self.dropped[reason] += count
        self.kept = self.kept & ~rows


def _spans_of(drive: RecordedDrive, drops: _DropLog, period_s: float) -> IntArray:
    """(N,) index of the episode of each intent; drops those outside and those too close."""
    if not drive.episodes:
        drops.drop(np.ones_like(drops.kept), OUTSIDE_EPISODE)
        return np.zeros(len(drops.kept), dtype=np.int64)
    time_s = drive.intent_time_s + _STAMP_TOLERANCE_S
    starts_s, ends_s, outcome = _columns(drive.episodes)
    span = np.searchsorted(starts_s, time_s, side="right") - 1
    inside = (span >= 0) & (time_s < ends_s[span])
    drops.drop((span >= 0) & ~inside & (outcome[span] == CUT_OFF), AFTER_CUT_OFF)
    drops.drop(~inside, OUTSIDE_EPISODE)
    drops.drop(outcome[span] == DISCARDED, IN_DISCARDED)
    drops.drop(outcome[span] == RETURN, ON_WAY_BACK)
    drops.drop(_too_close(drive.intent_time_s, span, inside, period_s), WITHIN_PERIOD)
    return span


def _too_close(time_s: FloatArray, span: IntArray, inside: BoolArray, period_s: float) -> BoolArray:
    close = np.zeros(len(time_s), dtype=bool)
    last_s, last_span = -np.inf, -1
    for row in np.flatnonzero(inside):
        if span[row] == last_span and time_s[row] < last_s + period_s - _STAMP_TOLERANCE_S:
            close[row] = True
        else:
            last_s, last_span = time_s[row], int(span[row])
    return close


def _ends(drive: RecordedDrive, span: IntArray, drops: _DropLog, period_s: float) -> FloatArray:
    """(N,) when each decision's period ends; drops those whose episode ends before, not arrived."""
    due_s = drive.intent_time_s + period_s
    if not drive.episodes:
        return due_s
    _, ends_s, outcome = _columns(drive.episodes)
    early = ends_s[span] < due_s - _STAMP_TOLERANCE_S
    drops.drop(early & (outcome[span] != "arrived"), CUT_SHORT)
    return np.minimum(due_s, ends_s[span])


def _columns(episodes: Sequence[EpisodeSpan]) -> tuple[FloatArray, FloatArray, NDArray[np.str_]]:
    """Starts and ends (s), and outcomes."""
    rows = zip(*((span.start_s, span.end_s, span.outcome) for span in episodes), strict=True)
    starts_s, ends_s, outcomes = map(np.array, rows)
    return starts_s, ends_s, outcomes


def _positions(drive: RecordedDrive, times_s: FloatArray) -> tuple[FloatArray, BoolArray]:
    """(N, 2) places interpolated between recorded poses; (N,) false across a gap of them."""
    recorded_s = drive.pose_time_s
    if not len(recorded_s):
        return np.full((len(times_s), 2), np.nan), np.zeros(len(times_s), dtype=bool)
    after = np.searchsorted(recorded_s, times_s - _STAMP_TOLERANCE_S)
    within = after < len(recorded_s)
    after = np.minimum(after, len(recorded_s) - 1)
    exact = np.abs(recorded_s[after] - times_s) <= _STAMP_TOLERANCE_S
    gap_s = recorded_s[after] - recorded_s[np.maximum(after - 1, 0)]
    known = within & (exact | ((after > 0) & (gap_s <= drive.longest_gap_s)))
    columns = [np.interp(times_s, recorded_s, column) for column in drive.position_m.T]
    return np.stack(columns, axis=1), known


def _assign(
    grid: Grid, state: IntArray, reached: IntArray, end_m: FloatArray, kept: BoolArray
) -> NDArray[np.object_]:
    """(N,) kinds of moves; puts the next state of the rule in place of the cell reached, -1 where
    no neighbour explains the move."""
    moves = np.full(len(state), Move.ADJACENT, dtype=object)
    adjacent = (reached == state) | (grid.neighbours[state] == reached[:, None]).any(axis=1)
    for row in np.flatnonzero(kept & ~adjacent):
        reached[row], moves[row] = next_state_of(
            grid, int(state[row]), int(reached[row]), end_m[row]
        )
    return moves
