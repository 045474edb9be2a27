"""When the strategy gives up a drive, and why.

Progress is a new minimum of the mean remaining time: a robot that waits, is carried back or goes in
circles makes none. The probability is that of arriving in the time that is left. The time-out is
not counted here.
"""

from enum import Enum

from serd_app.navigation.settings import NavigationSettings
from serd_core.arrival.chain import ArrivalByState


class GiveUp(Enum):
    """The reason, as it stands in marks and tables."""

    NO_PROGRESS = "no progress"
    UNLIKELY = "arrival unlikely"


class ProgressMonitor:
    """Follows one drive by the rules of the settings, decision by decision."""

    def __init__(self, settings: NavigationSettings) -> None:
        self._patience_periods = settings.patience_periods
        self._minimum_probability = settings.minimum_arrival_probability
        self.periods_without_progress = 0
        self._minimum_mean = float("inf")

    def reset(self) -> None:
        """Start again: the drive, its goal or its model changed."""
        self.periods_without_progress = 0
        self._minimum_mean = float("inf")

    def update(self, arrival: ArrivalByState, state: int, n_periods_left: int) -> GiveUp | None:
        """The reason to give up at the next decision; None to go on. state: -1 off the grid."""
        mean = float(arrival.mean_periods[state]) if state >= 0 else float("inf")
        if mean < self._minimum_mean:
            self._minimum_mean, self.periods_without_progress = mean, 0
        else:
            self.periods_without_progress += 1
        if 0 < self._patience_periods <= self.periods_without_progress:
            return GiveUp.NO_PROGRESS
        if state < 0:
            return None
        unlikely = float(arrival.within(n_periods_left)[state]) < self._minimum_probability
        return GiveUp.UNLIKELY if unlikely else None
