"""From the first prediction of a drive to its row in the log of arrivals."""

from pathlib import Path

from serd_app.navigation.arrival_log import append_arrival
from serd_app.navigation.navigator import Navigator
from serd_app.navigation.prediction import Prediction, arrival_row, prediction_of
from sim.world.observation import Observation
from storage.episode_table import EpisodeResult


class ArrivalRecords:
    """Keeps `arrivals.csv` in a folder; none when it is empty."""

    def __init__(self, output: str) -> None:
        self._path = Path(output) / "arrivals.csv" if output else None
        self._prediction: Prediction | None = None

    def renew(self) -> None:
        """Goal or model is another: what was foretold so far counts no more."""
        self._prediction = None

    def note(self, navigator: Navigator, observation: Observation) -> None:
        """Keep what the decision just taken foretells, if it is the drive's first."""
        if self._prediction is None:
            self._prediction = prediction_of(navigator, observation)

    def ended(self, result: EpisodeResult) -> None:
        """Append the row of a drive that was foretold."""
        prediction, self._prediction = self._prediction, None
        if prediction is not None and self._path is not None:
            append_arrival(
                self._path,
                arrival_row(
                    prediction,
                    episode=result.episode,
                    seed=result.seed,
                    outcome=result.outcome,
                    reason=result.reason,
                    time_of_arrival_s=result.time_of_arrival_s,
                ),
            )
