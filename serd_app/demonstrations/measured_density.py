"""Density of people at each decision, and its mean in each cell, from recorded people.

Both are sums of `serd_core.grid.density.crowd_shares` at centres of cells, of the last sighting of
people that is not later than the decision, or of the other agents of a table at that time.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from serd_app.demonstrations.recorded import RecordedDemonstrations, files_beside
from serd_app.drives.recorded_people import Sighting
from serd_app.drives.recording import Recording
from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.density import crowd_shares
from serd_core.grid.grid import Action, Grid
from storage.errors import FileError
from storage.files import delete_file
from storage.table import Column, read_table, write_table

#: Age of a sighting from which on the density is not known.
LONGEST_AGE_S = 1.0
_TOLERANCE_S = 1e-6
AIMED_AT = tuple(f"{action.name.lower()}_pm2" for action in Action)
COLUMNS = (
    Column("episode", int),
    Column("time_s", float),
    *(Column(name, float, nullable=True) for name in AIMED_AT),
)
MEAN_COLUMNS = (
    Column("state", int),
    Column("x_m", float),
    Column("y_m", float),
    Column("density_pm2", float),
)


@dataclass(frozen=True, eq=False)
class MeasuredDensity:
    """aimed_at_pm2: (N, 5) in the cell that each action aims at, NaN where it is not known.

    mean_pm2: (S,) over the decisions at which it is known.
    """

    aimed_at_pm2: FloatArray
    mean_pm2: FloatArray

    @property
    def n_known(self) -> int:
        """Decisions at which people were seen."""
        return int(np.isfinite(self.aimed_at_pm2[:, 0]).sum())


def density_at(
    grid: Grid, decisions: Decisions, time_s: FloatArray, people_m: Sequence[FloatArray]
) -> MeasuredDensity:
    """From people (n, 2) at each of the ascending times (T,)."""
    return _density(grid, decisions, _last_seen(decisions.time_s, time_s, people_m))


def people_around(
    recording: Recording, drive: int, sightings: Sequence[Sighting]
) -> Callable[[FloatArray], list[FloatArray | None]]:
    """From times (T,) to the people (n, 2) around the agent of a drive, None where not known.

    sightings: of a bag; they count where the clock does not go back.
    """
    crowd = recording.crowd
    if crowd is not None:
        return lambda asked_s: list(crowd.others_at(drive, asked_s))
    time_s = np.array([one.time_s for one in sightings])
    places_m = (one.people.position_m[:, :2] for one in sightings)
    people_m = [each[np.isfinite(each).all(axis=1)] for each in places_m]
    if np.any(np.diff(time_s) < 0):
        time_s = np.zeros(0)
    return lambda asked_s: _last_seen(asked_s, time_s, people_m)


def _last_seen(
    asked_s: FloatArray, time_s: FloatArray, people_m: Sequence[FloatArray]
) -> list[FloatArray | None]:
    last = np.searchsorted(time_s, asked_s + _TOLERANCE_S, side="right") - 1
    return [
        None if moment < 0 or at_s - time_s[moment] > LONGEST_AGE_S else people_m[moment]
        for moment, at_s in zip(last.tolist(), asked_s.tolist(), strict=True)
    ]


def _density(
    grid: Grid, decisions: Decisions, people_m: Sequence[FloatArray | None]
) -> MeasuredDensity:
    """From the people at each decision, None where they are not known."""
    aimed_at, total, n_known = np.full((len(decisions), len(Action)), np.nan), 0.0, 0
    for row, (people, state) in enumerate(zip(people_m, decisions.state, strict=True)):
        if people is None:
            continue
        field = crowd_shares(grid.centers_m, people).sum(axis=1)
        aimed_at[row] = field[grid.neighbours[state]]
        total, n_known = total + field, n_known + 1
    return MeasuredDensity(aimed_at, np.broadcast_to(total / max(n_known, 1), grid.n_states))


def joined_density(parts: Sequence[MeasuredDensity]) -> MeasuredDensity:
    """The rows of all parts; the mean is over all of their decisions."""
    counts = np.array([each.n_known for each in parts])
    mean = np.stack([each.mean_pm2 for each in parts], axis=1) @ counts / max(counts.sum(), 1)
    return MeasuredDensity(np.concatenate([each.aimed_at_pm2 for each in parts]), mean)


def density_of_recordings(
    found: Sequence[RecordedDemonstrations], sightings: Sequence[Sequence[Sighting]], grid: Grid
) -> MeasuredDensity | None:
    """Of all decisions, in the order of `concatenated`; None where no people were seen at any.

    sightings: of each recording.
    """
    parts = []
    for each, people in zip(found, sightings, strict=True):
        ends = np.cumsum(each.n_of_drives)
        for drive, rows in enumerate(np.split(np.arange(len(each.decisions)), ends[:-1])):
            decisions = each.decisions.select(rows)
            around = people_around(each.recording, drive, people)
            parts.append(_density(grid, decisions, around(decisions.time_s)))
    joined = joined_density(parts)
    return joined if joined.n_known else None


def save_density(
    table: Path, grid: Grid, decisions: Decisions, density: MeasuredDensity | None
) -> None:
    """Write both tables beside a table of decisions, or remove those of other recordings."""
    files = files_beside(table)
    if density is None:
        for name in ("density", "mean density"):
            delete_file(files[name])
        return
    numbers = zip(decisions.episode.tolist(), decisions.time_s.tolist(), strict=True)
    aimed_at = density.aimed_at_pm2.round(4).tolist()
    rows = ((*moment, *row) for moment, row in zip(numbers, aimed_at, strict=True))
    write_table(files["density"], COLUMNS, rows)
    places = zip(grid.centers_m.tolist(), density.mean_pm2.round(4).tolist(), strict=True)
    write_table(
        files["mean density"],
        MEAN_COLUMNS,
        ((state, *centre, mean) for state, (centre, mean) in enumerate(places)),
    )


def load_density(table: Path, grid: Grid, decisions: Decisions) -> MeasuredDensity:
    """What `save_density` wrote; FileError where it is missing or of other decisions or cells."""
    files = files_beside(table)
    if not files["density"].exists():
        raise FileError(
            f"{files['density']} must be there to learn with density, 'serd demos' writes it for"
            " recordings that hold people; record 'pedestrians'"
        )
    rows = read_table(files["density"], COLUMNS)
    means = read_table(files["mean density"], MEAN_COLUMNS)
    same = len(rows) == len(decisions) and bool(
        np.all(rows["episode"] == decisions.episode) and np.all(rows["time_s"] == decisions.time_s)
    )
    if not same or len(means) != grid.n_states:
        raise FileError(
            f"{files['density']} must have a row for each decision of {table} and"
            f" {files['mean density']} one for each of {grid.n_states} cells; run 'serd demos'"
            " again"
        )
    return MeasuredDensity(rows[list(AIMED_AT)].to_numpy(), means["density_pm2"].to_numpy())
