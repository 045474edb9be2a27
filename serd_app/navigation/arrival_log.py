"""Predicted and measured arrivals, one CSV row per episode, appended as they come.

Each row is one synced write, so that a killed process leaves whole rows.
"""

import math
from dataclasses import astuple, dataclass
from pathlib import Path

from serd_app.navigation.forecast import HALF, MOST, quantile_or_nan_s
from serd_app.navigation.navigator import Navigator
from serd_core.arrival.law import ArrivalLaw
from serd_files.episode_table import EpisodeResult
from serd_files.table import OptionalFloat, append_row, columns_of, read_rows
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation


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


def append_arrival(path: str | Path, row: ArrivalRow) -> None:
    """Append one row, below the column names in a new file."""
    append_row(path, columns_of(ArrivalRow), astuple(row))


def load_arrivals(path: str | Path) -> tuple[ArrivalRow, ...]:
    """All whole rows; FileError names the line of a fault."""
    return read_rows(path, ArrivalRow, growing=True)


@dataclass(frozen=True, eq=False)
class Prediction:
    """Made at the first decision for a goal and a model; law: seconds since the episode began."""

    start_m: tuple[float, float]
    scenario: Scenario
    model: str
    law: ArrivalLaw
    probability: float


class ArrivalRecords:
    """Writes `arrivals.csv` into the folder `output`; nothing when it is None."""

    def __init__(self, output: Path | None) -> None:
        self._path = output / "arrivals.csv" if output is not None else None
        self._prediction: Prediction | None = None

    def discard_prediction(self) -> None:
        """Discard the prediction: goal or model changed."""
        self._prediction = None

    def note_decision(self, navigator: Navigator, observation: Observation) -> None:
        """Keep the forecast of the decision just made, if it is the first of the drive."""
        if self._prediction is None:
            self._prediction = prediction_of(navigator, observation)

    def note_result(self, result: EpisodeResult) -> None:
        """Append the row of a drive that has ended, if there is a prediction of it."""
        prediction, self._prediction = self._prediction, None
        if prediction is not None and self._path is not None:
            append_arrival(self._path, arrival_row(prediction, result))


def prediction_of(navigator: Navigator, observation: Observation) -> Prediction | None:
    """The prediction of the decision just made, None off the grid."""
    forecast = navigator.forecast
    if forecast is None or forecast.state < 0:
        return None
    return Prediction(
        start_m=(observation.x_m, observation.y_m),
        scenario=navigator.strategy.scenario,
        model=navigator.model,
        law=forecast.law.delayed(forecast.elapsed_s),
        probability=forecast.probability,
    )


def arrival_row(prediction: Prediction, result: EpisodeResult) -> ArrivalRow:
    """The row of a drive that has ended."""
    area, law = prediction.scenario.goal_area_m, prediction.law
    time_s = result.time_of_arrival_s
    return ArrivalRow(
        episode=result.episode,
        seed=result.seed,
        start_x_m=prediction.start_m[0],
        start_y_m=prediction.start_m[1],
        goal_x_m=sum(x for x, _ in area) / len(area),
        goal_y_m=sum(y for _, y in area) / len(area),
        model=prediction.model,
        outcome=result.outcome,
        reason=result.reason,
        predicted_probability=prediction.probability,
        predicted_median_s=quantile_or_nan_s(law, HALF),
        predicted_most_s=quantile_or_nan_s(law, MOST),
        time_of_arrival_s=time_s,
        predicted_share=math.nan if math.isnan(time_s) else float(law.probability_by(time_s)),
    )
