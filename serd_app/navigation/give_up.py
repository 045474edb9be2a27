"""When the strategy stops trying, and why.

Progress is a new least of the mean remaining time: whoever waits, is carried back or goes round in
circles makes none. The chances are those of arriving in the time that is left. A drive that takes
longer than its time-out is ended by whoever counts the time.
"""

from dataclasses import dataclass
from enum import Enum

from serd_core.arrival.chain import ArrivalByState
from serd_core.errors import SerdError


class GiveUp(Enum):
    """Why, in the words that stand in marks and tables."""

    NO_PROGRESS = "no progress"
    UNLIKELY = "arrival unlikely"


@dataclass(frozen=True)
class GiveUpRules:
    """patience_periods: decision periods without progress, 0 for any number.

    minimum_arrival_probability: of arriving before the time-out; 0 never gives up for it.
    """

    patience_periods: int
    minimum_arrival_probability: float

    def __post_init__(self) -> None:
        if self.patience_periods < 0:
            raise SerdError(
                f"patience_periods must not be negative, got {self.patience_periods}; 0 is endless"
            )
        if not 0.0 <= self.minimum_arrival_probability <= 1.0:
            raise SerdError(
                "minimum_arrival_probability must be a probability, got "
                f"{self.minimum_arrival_probability}; use for example 0.01"
            )


class Patience:
    """Follows one drive, one decision after the other."""

    def __init__(self, rules: GiveUpRules) -> None:
        self.rules = rules
        self.periods_without_progress = 0
        self._least_s = float("inf")

    def renew(self) -> None:
        """Begin to count anew: the drive, its goal or its model is another."""
        self.periods_without_progress = 0
        self._least_s = float("inf")

    def see(self, arrival: ArrivalByState, state: int, n_periods_left: int) -> GiveUp | None:
        """Take the state of the next decision, -1 off the grid; why to give up, None to go on."""
        mean = float(arrival.mean_periods[state]) if state >= 0 else float("inf")
        if mean < self._least_s:
            self._least_s, self.periods_without_progress = mean, 0
        else:
            self.periods_without_progress += 1
        if 0 < self.rules.patience_periods <= self.periods_without_progress:
            return GiveUp.NO_PROGRESS
        if state >= 0 and self._is_unlikely(float(arrival.within(n_periods_left)[state])):
            return GiveUp.UNLIKELY
        return None

    def _is_unlikely(self, probability: float) -> bool:
        return probability < self.rules.minimum_arrival_probability
