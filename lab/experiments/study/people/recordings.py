"""Runs of a measured corridor: the way of each person in coordinates in which all walk ahead.

x is along the corridor and grows in the direction in which a person walks, y is to the left; the
middle of the measured area is the origin. Those who walk the other way are turned by half a turn,
so that one decision problem holds for both: left stays left.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from lab.crowd.straight_corridor import CorridorPeople, corridor_people, longest_step_s
from lab.experiments.study.people.settings import GridSettings, PeopleSettings
from serd_app.demonstrations.decision_table import concatenate
from serd_app.demonstrations.discretise import decisions_from_drive
from serd_app.drives.drive import EpisodeSpan, RecordedDrive
from serd_app.places.free_area import read_area_m, stated_area_m
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.decisions import HIDDEN, TimedDecisions
from serd_core.errors import SerdError
from serd_core.grid.grid import Grid
from serd_files.trajectories.columns import TableColumns
from serd_files.trajectories.read import Track, Trajectories, read_trajectories
from serd_sim.errors import SimError

#: Median speeds of people who walk; outside, units or frames per second are wrong.
SLOWEST_MPS, FASTEST_MPS = 0.05, 4.0
#: A step faster than that is a jump of the id.
JUMP_MPS = 8.0
#: Between centres and walls.
BODY_RADIUS_M = 0.2
_FEWEST_WALKERS = 10


@dataclass(frozen=True, eq=False)
class Walker:
    """time_s (T,), position_m (T, 2) ahead and left; sign: 1, or -1 where turned."""

    name: str
    sign: int
    time_s: FloatArray
    position_m: FloatArray

    def ahead_m(self, time_s: float) -> float:
        """How far along the corridor at a time."""
        return float(np.interp(time_s, self.time_s, self.position_m[:, 0]))


@dataclass(frozen=True, eq=False)
class Run:
    """One recording: grid of the measured area, its goal is the last column; width_m of the floor.

    walkers: those who walk through; decisions: theirs up to the goal, by the number of the walker,
    actions hidden; left_out: how many others, by reason; assumed: sentences.
    """

    name: str
    grid: Grid
    width_m: float
    walkers: tuple[Walker, ...]
    decisions: TimedDecisions
    left_out: dict[str, int]
    assumed: tuple[str, ...]

    @property
    def n_columns(self) -> int:
        """Cells along the corridor."""
        return int(self.grid.walkable.shape[1])

    @cached_property
    def column(self) -> IntArray:
        """(C,) column of each cell."""
        return self.grid.cells[:, 1]

    @cached_property
    def span_s(self) -> tuple[float, float]:
        """First and last time of a walker."""
        ends = [(walker.time_s[0], walker.time_s[-1]) for walker in self.walkers]
        return float(min(each[0] for each in ends)), float(max(each[1] for each in ends))

    @property
    def goal_line_m(self) -> float:
        """Where the last column begins."""
        return float(self.grid.origin_m[0] + (self.n_columns - 1) * self.grid.cell_size_m)


def read_runs(
    paths: Sequence[Path], columns: TableColumns | None, settings: PeopleSettings
) -> tuple[Run, ...]:
    """The runs of the files; SerdError naming the file that holds none."""
    names = [path.stem for path in paths]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise SerdError(f"files must have different names, got {twice[0]} twice; rename one")
    return tuple(_run(path, read_trajectories(path, columns), settings) for path in paths)


def _run(path: Path, found: Trajectories, settings: PeopleSettings) -> Run:
    left_out = Counter[str]()
    people = _in_corridor(path, _without_jumps(path, found.tracks, left_out), settings)
    if people.n_apart:
        left_out["away from the corridor"] = people.n_apart
    tracks, along, across = people.tracks, people.axis, 1 - people.axis
    low, high = people.sides_m or _sides_m(tracks, along)
    ends = np.array([sorted(t.position_m[[0, -1], along]) for t in tracks])
    origin = np.zeros(2)
    origin[along], origin[across] = np.median(ends, axis=0).mean(), (low + high) / 2
    ways = [_turned(track, along, origin) for track in tracks]
    begin = float(np.percentile([way[1][0, 0] for way in ways], 90))
    end = float(np.percentile([way[1][-1, 0] for way in ways], 10))
    width_m = float(high - low)
    grid = _grid(path, begin, end, width_m, settings.grid)
    walkers, tables = list[Walker](), list[TimedDecisions]()
    for track, (sign, places) in zip(tracks, ways, strict=True):
        walker = Walker(track.agent, sign, track.time_s, places)
        every = _decisions(walker, len(walkers), grid, longest_step_s(track), settings)
        if (way := _up_to_the_goal(grid, every)) is not None:
            walkers.append(walker)
            tables.append(way)
        else:
            left_out["not through the measured area"] += 1
    if len(walkers) < _FEWEST_WALKERS:
        reasons = ", ".join(f"{n} {reason}" for reason, n in left_out.items())
        raise SerdError(
            f"{path} must have at least {_FEWEST_WALKERS} people who walk through, got"
            f" {len(walkers)} of {len(found.tracks)}{f' ({reasons})' if reasons else ''}; check its"
            " columns and units by --mapping, or record more people"
        )
    assumed = (*found.assumed, *people.remarks)
    return Run(path.stem, grid, width_m, tuple(walkers), concatenate(tables), left_out, assumed)


def _without_jumps(
    path: Path, tracks: Sequence[Track], left_out: Counter[str]
) -> tuple[Track, ...]:
    kept, speeds, jumping = [], [], set()
    for track in tracks:
        step_s = np.diff(track.time_s)
        speed = np.hypot(*np.diff(track.position_m, axis=0).T) / step_s
        speeds.append(float(np.median(speed)))
        if track.divided_from or speed.max() > JUMP_MPS:
            jumping.add(track.divided_from or track.agent)
        elif step_s.max() > longest_step_s(track):
            left_out["away in between, so maybe two people of one id"] += 1
        else:
            kept.append(track)
    if jumping:
        left_out[f"a step faster than {JUMP_MPS:g} m/s"] = len(jumping)
    median = float(np.median(speeds))
    if not SLOWEST_MPS <= median <= FASTEST_MPS:
        raise SerdError(
            f"{path}: people must walk at {SLOWEST_MPS:g} to {FASTEST_MPS:g} m/s, but the median of"
            f" their speeds is {median:.3g} m/s; state unit: and fps: in a --mapping file"
        )
    if not kept:
        raise SerdError(
            f"{path}: every track has a step faster than {JUMP_MPS:g} m/s or a gap, as agent"
            f" {tracks[0].agent} from row {tracks[0].row}; give each person an id of its own, and"
            " check the units"
        )
    return tuple(kept)


def _in_corridor(path: Path, tracks: Sequence[Track], settings: PeopleSettings) -> CorridorPeople:
    """Those in the corridor, which the settings may state as an area."""
    area_m = read_area_m(Path(settings.area)) if settings.area else stated_area_m([path])
    try:
        return corridor_people(tracks, area_m)
    except SimError as error:
        raise SerdError(f"{path}: {error}") from None


def _sides_m(tracks: Sequence[Track], along: int) -> tuple[float, float]:
    """The walls by where people walk: their centres keep a body's radius away."""
    across = np.concatenate([t.position_m[:, 1 - along] for t in _through(tracks, along)])
    low, high = np.percentile(across, [0.5, 99.5])
    return float(low) - BODY_RADIUS_M, float(high) + BODY_RADIUS_M


def _through(tracks: Sequence[Track], along: int) -> list[Track]:
    """Those who walk at least half as far as usual, so neither stand nor are cut off."""
    far_m = [float(np.ptp(track.position_m[:, along])) for track in tracks]
    least_m = float(np.median(far_m)) / 2
    return [track for track, each_m in zip(tracks, far_m, strict=True) if each_m >= least_m]


def _turned(track: Track, along: int, origin: FloatArray) -> tuple[int, FloatArray]:
    """(sign, (T, 2) ahead and left)."""
    places = track.position_m - origin
    sign = 1 if places[-1, along] >= places[0, along] else -1
    left = sign if along == 0 else -sign
    return sign, np.stack([sign * places[:, along], left * places[:, 1 - along]], axis=1)


def _grid(path: Path, begin: float, end: float, width_m: float, settings: GridSettings) -> Grid:
    """Symmetric about the origin, so that both directions have the same cells."""
    half_m, cell_m = min(-begin, end), settings.cell_size_m
    n_columns = int(2 * half_m / cell_m)
    if n_columns < settings.observed_cells + 3:
        raise SerdError(
            f"{path} must show at least {settings.observed_cells + 3} cells of {cell_m:g} m along"
            f" the corridor, got {max(n_columns, 0)}; choose a smaller cell_size_m"
        )
    n_rows = max(1, round(width_m / cell_m))
    corner = (-n_columns * cell_m / 2, -n_rows * cell_m / 2)
    return Grid(corner, cell_m, np.ones((n_rows, n_columns), dtype=np.bool_))


def _decisions(
    walker: Walker, number: int, grid: Grid, longest_gap_s: float, settings: PeopleSettings
) -> TimedDecisions:
    """All decisions of a person, whose actions nobody knows."""
    begin_s, end_s = float(walker.time_s[0]), float(walker.time_s[-1])
    drive = RecordedDrive(
        pose_time_s=walker.time_s,
        position_m=walker.position_m,
        intent_time_s=np.array([begin_s]),
        intent_action=np.array([HIDDEN]),
        episodes=(EpisodeSpan(number, begin_s, end_s, "unmarked"),),
        intent_hold_s=np.inf,
        longest_gap_s=longest_gap_s,
    )
    return decisions_from_drive(drive, grid, settings.patience_s, settings.wait_s)[0]


def _up_to_the_goal(grid: Grid, decisions: TimedDecisions) -> TimedDecisions | None:
    """Those that lead from one of the first two columns into the last one; None for no such way.

    The first decision is left out, as the person may have been in its cell before.
    """
    column = grid.cells[:, 1]
    arrived = np.flatnonzero(column[decisions.next_state] == column.max())
    if not len(arrived) or column[decisions.state[0]] > 1:
        return None
    return decisions.select(np.arange(1, arrived[0] + 1))
