"""From a recorded drive to decisions on a grid, each with its outcome and dwell time.

The poses of an episode go through `DecisionEpochs`, as those of a drive do. The action is the
command that is in force when a decision begins: the newest one, for as long as it holds. A slanted
one is for the cell that it leads to first from where the robot is. Another
command that has been in force for 0.3 s ends the decision before its outcome (censored), at the
time from which on it was given. Without a command nothing is decided. Everything that is left out
is counted.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from serd_app.demonstrations.decision_table import concatenate_renumbered
from serd_app.drives.drive import (
    CUT_OFF,
    DISCARDED,
    RETURN,
    SILENCE,
    EpisodeSpan,
    RecordedDrive,
    places_at,
)
from serd_app.drives.mapped import mapped_drive_in
from serd_app.drives.mapping import BagMapping
from serd_app.drives.sessions import read_drives
from serd_bag.errors import BagError
from serd_bag.reader import BagReader
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.demonstrations.decisions import HIDDEN, TimedDecisions
from serd_core.grid.grid import Action, Grid
from serd_files.yaml_config import StrictModel
from serd_sim.world.epochs import (
    HELD_S,
    DecisionEpochs,
    Epoch,
    decisions_of,
    hysteresis_m,
)

OUTSIDE_EPISODE = "outside any episode"
AFTER_CUT_OFF = "after an episode whose end is not recorded"
IN_DISCARDED = "in a discarded episode"
ON_WAY_BACK = "on the way back from the goal"
NO_COMMAND = "no command recorded then"
LOST = "lost as poses are missing or beyond walls"
OFF_GRID = "robot off the grid"
REPEATED = "of an episode that was there before"
#: Share of decisions to wait while the robot moves above which actions do not explain the motion.
MOST_MOVING_WAITS = 0.02
#: Longer steps between poses are divided: decisions end between them.
_LONGEST_STEP_S = 0.2
_STAMP_TOLERANCE_S = 1e-6
#: Cosine of the angle by which a straight way may turn within so many seconds: 10 degrees.
_TURN_S, _STRAIGHT = 0.5, float(np.cos(np.pi / 18))
#: Tangent of the angle to both axes from which on a way is slanted: 22.5 degrees.
_SLANTED = float(np.tan(np.pi / 8))
#: What is counted while a drive is read.
_COUNTED = ("n_bad_poses", "n_unplaced_poses", "n_bad_commands")
_Count = Annotated[int, Field(ge=0)]


class DiscretisationReport(StrictModel):
    """n_decisions kept, of which n_censored ended before their outcome, by another command or with
    the episode; dropped: intents and decisions that were left out, by why.

    n_bad_poses: poses that were left out because a number in them is not finite.
    n_unplaced_poses: those left out because no transform was recorded about their time.
    n_bad_commands: velocity commands left out because a number in them is not finite.
    n_moving_waits: decisions to wait in whose second half, after braking, the robot moved.
    """

    n_decisions: _Count
    n_censored: _Count
    n_episodes: _Count
    dropped: dict[str, int] = Field(default_factory=dict)
    n_bad_poses: _Count = 0
    n_unplaced_poses: _Count = 0
    n_bad_commands: _Count = 0
    n_moving_waits: _Count = 0

    @property
    def n_dropped(self) -> int:
        """Intents and decisions that were left out."""
        return sum(self.dropped.values())

    @property
    def n_taken(self) -> int:
        """Decisions that were taken, with those whose outcome is not recorded."""
        return self.n_decisions + self.dropped.get(LOST, 0)

    @property
    def fault_share(self) -> float:
        """Of the decisions, those whose outcome is not recorded: see `LOST`."""
        return self.dropped.get(LOST, 0) / self.n_taken if self.n_taken else 0.0

    @property
    def faults(self) -> str:
        """One sentence about such decisions."""
        return (
            f"{100 * self.fault_share:.1f} % of {self.n_taken} decisions are lost as poses are"
            " missing or beyond walls"
        )

    def __str__(self) -> str:
        """One sentence with every count."""
        dropped = ", ".join(f"{count} {reason}" for reason, count in sorted(self.dropped.items()))
        return (
            f"{self.n_decisions} decisions in {self.n_episodes} episodes, {self.n_censored} of them"
            f" without outcome; dropped: {dropped or 'none'}"
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


def demonstrations_of_bag(
    bag: str | Path,
    grid: Grid,
    patience_s: float,
    wait_s: float,
    mapping: BagMapping | None = None,
) -> tuple[TimedDecisions, DiscretisationReport]:
    """Those of a bag, and what was left out; BagError where there is nothing to use.

    patience_s, wait_s: see `DecisionEpochs`. mapping: of a bag of another robot.
    """
    drives = read_drives(bag) if mapping is None else [mapped_drive_in(BagReader(bag), mapping)]
    decisions, report = demonstrations_of_drives(drives, grid, patience_s, wait_s)
    if not len(decisions):
        raise BagError(f"bag {bag} holds no decision to learn from: {report}; record more")
    return decisions, report


def demonstrations_of_drives(
    drives: Sequence[RecordedDrive],
    grid: Grid,
    patience_s: float,
    wait_s: float,
    *,
    seen: set[bytes] | None = None,
    agents: bool = False,
) -> tuple[TimedDecisions, DiscretisationReport]:
    """Those of all drives of one recording, at least one, and what was left out.

    seen: `episode_rows` of earlier episodes, to which those of the drives are added; an episode
    that was seen in every decision counts once. agents: the drives are of different agents, of whom
    two may decide the same at the same times, so that those of the same places alone are repeated.
    """
    seen = set() if seen is None else seen
    known = frozenset(seen)
    tables, reports = [], []
    for drive in drives:
        track = drive.pose_time_s.tobytes() + drive.position_m.tobytes()
        seen_here = set(known if track in known else ()) if agents else seen
        decisions, report = decisions_from_drive(drive, grid, patience_s, wait_s, seen_here)
        seen |= seen_here | ({track} if agents else set())
        tables.append(decisions)
        reports.append(report)
    return concatenate_renumbered(tables), joined_reports(reports)


def decisions_from_drive(
    drive: RecordedDrive,
    grid: Grid,
    patience_s: float,
    wait_s: float,
    seen: set[bytes] | None = None,
) -> tuple[TimedDecisions, DiscretisationReport]:
    """Decisions of a recorded drive on a grid, and what was left out.

    patience_s, wait_s: see `DecisionEpochs`. seen: `episode_rows` of episodes that are dropped
    here, to which those of this drive are added.
    """
    dropped = Counter(drive.dropped) + _outside(drive)
    epochs = DecisionEpochs(grid, patience_s=patience_s, wait_s=wait_s)
    ended = dict[int, Sequence[Epoch]]()
    for span in (span for span in drive.episodes if span.demonstrates):
        dropped[NO_COMMAND] += _follow(epochs, drive, span, patience_s)
        dropped[LOST] += epochs.n_lost
        ended[span.number] = epochs.ended
    every = decisions_of(ended, drive.source)
    dropped[OFF_GRID] += sum(map(len, ended.values())) - len(every)
    repeated = _repeated(every, set() if seen is None else seen)
    dropped[REPEATED] += int(repeated.sum())
    decisions = every.select(~repeated)
    return decisions, DiscretisationReport(
        n_decisions=len(decisions),
        n_censored=int(decisions.censored.sum()),
        n_episodes=len(decisions.episodes),
        dropped=dict(+dropped),
        **{name: getattr(drive, name) for name in _COUNTED},
        n_moving_waits=_moving_waits(drive, decisions),
    )


def episode_rows(decisions: TimedDecisions) -> dict[int, bytes]:
    """Every decision of each episode as bytes, by which repeated episodes are recognised."""
    columns = (decisions.time_s, decisions.state, decisions.action, decisions.next_state)
    return {
        int(episode): b"".join(column[decisions.episode == episode].tobytes() for column in columns)
        for episode in decisions.episodes
    }


def _repeated(decisions: TimedDecisions, seen: set[bytes]) -> BoolArray:
    """(N,) decisions of episodes that were seen already in every decision; adds the others."""
    rows = episode_rows(decisions)
    repeated = [episode for episode, row in rows.items() if row in seen]
    seen.update(rows.values())
    return np.isin(decisions.episode, repeated)


def _outside(drive: RecordedDrive) -> Counter[str]:
    """Intents that are in no episode which demonstrates, by why."""
    if not drive.episodes:
        return Counter({OUTSIDE_EPISODE: len(drive.intent_time_s)})
    time_s = drive.intent_time_s + _STAMP_TOLERANCE_S
    rows = zip(*((span.start_s, span.end_s, span.outcome) for span in drive.episodes), strict=True)
    starts_s, ends_s, outcomes = map(np.array, rows)
    span = np.searchsorted(starts_s, time_s, side="right") - 1
    inside, outcome = (span >= 0) & (time_s < ends_s[span]), outcomes[span]
    cut_off = (span >= 0) & ~inside & (outcome == CUT_OFF)
    reasons: Mapping[str, BoolArray] = {
        AFTER_CUT_OFF: cut_off,
        OUTSIDE_EPISODE: ~inside & ~cut_off,
        IN_DISCARDED: inside & (outcome == DISCARDED),
        ON_WAY_BACK: inside & (outcome == RETURN),
    }
    return Counter({reason: int(found.sum()) for reason, found in reasons.items()})


def _follow(
    epochs: DecisionEpochs, drive: RecordedDrive, span: EpisodeSpan, patience_s: float
) -> int:
    """Divide an episode into decisions; how many times it fell silent."""
    time_s, position_m, after_gap = _way(drive, span)
    hold_s = patience_s if drive.intent_hold_s is None else drive.intent_hold_s
    since_s, commands = _in_force(drive, span, hold_s)
    row = np.searchsorted(since_s, time_s + _STAMP_TOLERANCE_S, side="right") - 1
    columns = time_s, *position_m.T, after_gap, since_s[row], commands[row]
    epochs.begin()
    taken, n_silent = int(Action.WAIT), 0
    for at_s, x_m, y_m, is_after_gap, from_s, command in zip(
        *(column[:-1].tolist() for column in columns), strict=True
    ):
        if is_after_gap:
            epochs.lose()
        if epochs.see(at_s, x_m, y_m):
            if command != SILENCE:
                epochs.take(at_s, _aimed(drive, epochs, at_s, (x_m, y_m), command))
        elif command != taken and at_s - from_s >= HELD_S - _STAMP_TOLERANCE_S:
            epochs.interrupt(from_s)
            if command != SILENCE:
                epochs.take(from_s, _aimed(drive, epochs, from_s, (x_m, y_m), command))
        else:
            continue
        n_silent += command == SILENCE != taken
        taken = command
    if not len(time_s) or after_gap[-1] or span.end_s - time_s[-1] > drive.longest_gap_s:
        epochs.lose()  # its end is not recorded
    else:
        arrived = span.outcome == "arrived"
        epochs.end(float(time_s[-1]), *map(float, position_m[-1]), arrived=arrived)
    return n_silent


def _aimed(
    drive: RecordedDrive,
    epochs: DecisionEpochs,
    at_s: float,
    place_m: tuple[float, float],
    command: int,
) -> int:
    """The action toward the cell that a slanted way enters first; the command where it is none."""
    row = int(np.searchsorted(drive.way_time_s, at_s + _STAMP_TOLERANCE_S, side="right")) - 1
    if row < 0 or command in (Action.WAIT, HIDDEN) or epochs.state < 0:
        return command
    way_m, grid = drive.way_m[row], epochs.grid
    if np.abs(way_m).min() < _SLANTED * np.abs(way_m).max():
        return command
    later_m = drive.way_m[np.searchsorted(drive.way_time_s[:-1], at_s + _TURN_S)]
    if way_m @ later_m < _STRAIGHT * np.hypot(*way_m) * np.hypot(*later_m):
        return command  # it turns
    from_middle_m = np.sign(way_m) * (np.array(place_m) - grid.centers_m[epochs.state])
    left_m = 0.5 * grid.cell_size_m + hysteresis_m(grid) - from_middle_m
    if left_m[0] * abs(way_m[1]) < left_m[1] * abs(way_m[0]):
        return int(Action.EAST if way_m[0] > 0 else Action.WEST)
    return int(Action.NORTH if way_m[1] > 0 else Action.SOUTH)


def _way(drive: RecordedDrive, span: EpisodeSpan) -> tuple[FloatArray, FloatArray, BoolArray]:
    """(T,) times and (T, 2) places of an episode, and (T,) whether a gap is before each.

    Long steps between poses are divided evenly.
    """
    recorded_s = drive.pose_time_s
    first = np.searchsorted(recorded_s, span.start_s - _STAMP_TOLERANCE_S)
    last = np.searchsorted(recorded_s, span.end_s + _STAMP_TOLERANCE_S)
    time_s, position_m = recorded_s[first:last], drive.position_m[first:last]
    step_s = np.diff(time_s, prepend=time_s[:1])
    after_gap = step_s > drive.longest_gap_s
    n_parts = np.ceil(step_s / _LONGEST_STEP_S - _STAMP_TOLERANCE_S).clip(1).astype(np.int64)
    n_parts[after_gap] = 1
    if n_parts.max(initial=1) == 1:
        return time_s, position_m, after_gap
    whole = np.repeat(np.arange(len(time_s)), n_parts)
    parts_left = np.cumsum(n_parts)[whole] - 1 - np.arange(len(whole))
    divided_s = time_s[whole] - parts_left * (step_s / n_parts)[whole]
    return divided_s, places_at(divided_s, time_s, position_m), after_gap[whole]


def _in_force(
    drive: RecordedDrive, span: EpisodeSpan, hold_s: float
) -> tuple[FloatArray, IntArray]:
    """(N,) from when on, what command is in force within an episode: an action, or SILENCE."""
    starts_s = drive.intent_time_s + _STAMP_TOLERANCE_S
    inside = (starts_s >= span.start_s) & (starts_s < span.end_s)
    given_s, given = drive.intent_time_s[inside], drive.intent_action[inside]
    silent_s = given_s + hold_s
    falls_silent = silent_s < np.append(given_s[1:], np.inf) - _STAMP_TOLERANCE_S
    from_s = np.concatenate([[-np.inf], given_s, silent_s[falls_silent]])
    command = np.concatenate([[SILENCE], given, np.full(falls_silent.sum(), SILENCE)])
    order = np.argsort(from_s, kind="stable")
    from_s, command = from_s[order], command[order].astype(np.int64)
    changes = np.append(True, np.diff(command) != 0)
    return from_s[changes], command[changes]


def _moving_waits(drive: RecordedDrive, decisions: TimedDecisions) -> int:
    waits = decisions.select(decisions.action == Action.WAIT)
    if not len(waits):
        return 0
    half_s = waits.dwell_s / 2.0
    middle_m, end_m = (
        places_at(at_s, drive.pose_time_s, drive.position_m)
        for at_s in (waits.time_s + half_s, waits.time_s + waits.dwell_s)
    )
    return int((np.hypot(*(end_m - middle_m).T) >= drive.minimum_speed_mps * half_s).sum())
