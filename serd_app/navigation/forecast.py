"""The forecast of the time of arrival that goes with a decision, as numbers and as text."""

import math
from dataclasses import dataclass

from serd_app.navigation.strategy import TRAP_PROBABILITY
from serd_core.arrival.law import ArrivalLaw
from serd_core.arrival.trap_states import Traps
from serd_core.grid.grid import Action

#: Shares of drives whose times of arrival are reported: half, and nine in ten.
HALF, MOST = 0.5, 0.9


@dataclass(frozen=True, eq=False)
class ArrivalForecast:
    """Made at a decision. law: remaining seconds; state: -1 off the grid.

    probability: of arriving before the time-out. trapped: whether the state is a trap.
    """

    time_s: float
    elapsed_s: float
    state: int
    action: Action
    law: ArrivalLaw
    probability: float
    trapped: bool
    periods_without_progress: int

    @property
    def summary(self) -> str:
        """One line for a picture."""
        median_s = self.law.quantile_s(HALF)
        arrives = "no arrival expected" if median_s is None else f"arrives in {median_s:.0f} s"
        trapped = ", TRAPPED" if self.trapped else ""
        return f"{arrives}, before the time-out with {self.probability:.0%}{trapped}"

    @property
    def needs_attention(self) -> bool:
        """Whether the robot is off the grid or in a trap."""
        return self.state < 0 or self.trapped

    @property
    def situation(self) -> str:
        """What the robot does."""
        if self.state < 0:
            return "waiting: off the grid"
        if self.trapped:
            return "in a trap"
        return "waiting: action of the policy" if self.action == Action.WAIT else "driving"

    def values(self) -> dict[str, object]:
        """Numbers for `diagnostics`; a time that is never reached is NaN."""
        return {
            "state": self.state,
            "action": self.action.name.lower(),
            "elapsed_s": self.elapsed_s,
            "arrival_probability": self.probability,
            "median_remaining_s": quantile_or_nan_s(self.law, HALF),
            "most_remaining_s": quantile_or_nan_s(self.law, MOST),
            "periods_without_progress": self.periods_without_progress,
            "trapped": self.trapped,
        }


def quantile_or_nan_s(law: ArrivalLaw, share: float) -> float:
    """When a share of all drives has arrived; NaN where fewer ever do."""
    time_s = law.quantile_s(share)
    return math.nan if time_s is None else time_s


def traps_text(traps: Traps) -> str:
    """How many states are traps, and of which kind; empty when none is."""
    if not len(traps.states):
        return ""
    looping, unlikely = int(traps.looping.sum()), int(traps.unlikely.sum())
    return (
        f"{len(traps.states)} of {len(traps.looping)} cells are traps: from {looping} the greedy "
        f"actions never lead to the goal, from {unlikely} it is reached before the time-out with "
        f"less than {TRAP_PROBABILITY:.0%}"
    )
