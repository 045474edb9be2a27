"""Predicted and measured arrivals, one CSV row per episode, appended as they come.

Each row is one synced write, so that a killed process leaves whole rows.
"""

from dataclasses import astuple, dataclass
from pathlib import Path

from storage.table import OptionalFloat, append_row, columns_of, read_rows


@dataclass(frozen=True)
class ArrivalRow:
    """One drive, its prediction made at its start or at the last change of goal or model.

    outcome: arrived, timeout or aborted; reason: why it was given up, else empty.
    predicted_probability: of arriving in time; predicted_median_s, predicted_most_s: by which half
    and 90 % of such drives arrive, NaN where fewer ever do. time_of_arrival_s: NaN if it did not.
    predicted_share: predicted probability of arriving no later than it did; these are uniform on
    [0, 1] where predictions are right. All times are simulated seconds since the episode's start.
    """

    episode: int
    seed: int
    start_x_m: float
    start_y_m: float
    goal_x_m: float
    goal_y_m: float
    model: str
    outcome: str
    reason: str
    predicted_probability: float
    predicted_median_s: OptionalFloat
    predicted_most_s: OptionalFloat
    time_of_arrival_s: OptionalFloat
    predicted_share: OptionalFloat


COLUMNS = columns_of(ArrivalRow)


def append_arrival(path: str | Path, row: ArrivalRow) -> None:
    """Append one row, below the column names in a new file."""
    append_row(path, COLUMNS, astuple(row))


def load_arrivals(path: str | Path) -> tuple[ArrivalRow, ...]:
    """All whole rows; FileError names the line of a fault."""
    return read_rows(path, ArrivalRow, COLUMNS, growing=True)
