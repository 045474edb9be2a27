"""The forecast of the time of arrival that goes with a decision, as numbers and as text."""

import math
from dataclasses import dataclass

from serd_core.arrival.arriving_policy import TRAP_PROBABILITY, Traps
from serd_core.arrival.law import ArrivalLaw
from serd_core.grid.grid import Action
from serd_sim.drivers.strategy import Strategy

#: Shares of drives whose times of arrival are reported: half, and nine in ten.
HALF, MOST = 0.5, 0.9


@dataclass(frozen=True, eq=False)
class ArrivalForecast:
    """Made at a decision. law: remaining seconds; state: -1 off the grid.

    probability: of arriving before the time-out. trapped: whether the state is a trap; by_time:
    whether the way of least expected time is taken there, as the learned policy does not arrive.
    """

    time_s: float
    elapsed_s: float
    state: int
    action: Action
    law: ArrivalLaw
    probability: float
    trapped: bool
    decisions_without_progress: int
    by_time: bool = False

    @property
    def summary(self) -> str:
        """One line for a picture."""
        median_s = self.law.quantile_s(HALF)
        arrives = "no arrival expected" if median_s is None else f"arrives in {median_s:.0f} s"
        way = ", TRAPPED" if self.trapped else ", by the way of least expected time" * self.by_time
        return f"{arrives}, before the time-out with {self.probability:.0%}{way}"

    @property
    def needs_attention(self) -> bool:
        """Whether the robot is off the grid, in a trap, or where the learned policy is in one."""
        return self.state < 0 or self.trapped or self.by_time

    @property
    def situation(self) -> str:
        """What the robot does."""
        if self.state < 0:
            return "waiting: off the grid"
        if self.trapped:
            return "in a trap"
        if self.by_time:
            return (
                "driving the way of least expected time, as the learned policy does not arrive from"
                " here"
            )
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
            "decisions_without_progress": self.decisions_without_progress,
            "trapped": self.trapped,
            "least_time": self.by_time,
        }


def quantile_or_nan_s(law: ArrivalLaw, share: float) -> float:
    """When a share of all drives has arrived; NaN where fewer ever do."""
    time_s = law.quantile_s(share)
    return math.nan if time_s is None else time_s


def traps_text(traps: Traps) -> str:
    """From how many states no policy arrives, and why; empty when none is a trap."""
    if not len(traps.states):
        return ""
    looping, unlikely = int(traps.looping.sum()), int(traps.unlikely.sum())
    return (
        f"{len(traps.states)} of {len(traps.looping)} cells are traps: from {looping} no policy"
        f" leads to the goal, from {unlikely} it is reached before the time-out with less than"
        f" {TRAP_PROBABILITY:.0%}"
    )


def least_time_text(strategy: Strategy) -> str:
    """Where and why the learned policy is not followed; empty where it is followed everywhere."""
    if not strategy.by_time.any():
        return ""
    learned = strategy.driven.learned_traps
    return (
        f"the learned policy does not arrive from {len(learned.states)} of {len(learned.looping)}"
        f" cells: from {int(learned.looping.sum())} its actions never lead to the goal, from"
        f" {int(learned.unlikely.sum())} it is reached before the time-out with less than"
        f" {TRAP_PROBABILITY:.0%}; in {int(strategy.by_time.sum())} cells the way of least expected"
        " time is taken instead"
    )


def unused_features_text(strategy: Strategy) -> str:
    """Which weights of the model do not count in this place; empty where all do."""
    used = strategy.problem.feature_names
    unused = [name for name in strategy.file.feature_names if name not in used]
    if not unused:
        return ""
    return (
        f"the model's weight of {', '.join(unused)} is not used, as no flow of people is known"
        " here, or was where it was learned"
    )


def plan_remarks(strategy: Strategy) -> list[str]:
    """What somebody who lets the strategy drive must know of its plan, one sentence each."""
    texts = unused_features_text(strategy), least_time_text(strategy), traps_text(strategy.traps)
    return [text for text in texts if text]
