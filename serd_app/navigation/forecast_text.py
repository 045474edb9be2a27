"""What the strategy thinks of its way, in words and numbers."""

from serd_app.navigation.navigator import HALF, MOST, Outlook
from serd_app.navigation.strategy import TRAP_PROBABILITY, Strategy
from serd_core.arrival.trap_states import Traps
from serd_core.grid.grid import Action


def outlook_in_short(outlook: Outlook) -> str:
    """One line for a picture."""
    median_s = outlook.law.quantile_s(HALF)
    arrives = "no arrival in sight" if median_s is None else f"arrives in {median_s:.0f} s"
    trapped = ", TRAPPED" if outlook.trapped else ""
    return f"{arrives}, in time with {outlook.probability:.0%}{trapped}"


def situation_of(outlook: Outlook) -> tuple[bool, str]:
    """(whether somebody should look at it, what the robot is doing)."""
    if outlook.state < 0:
        return True, "waiting: off the grid"
    if outlook.trapped:
        return True, "in a trap"
    if outlook.action == Action.WAIT:
        return False, "waiting: the policy says so"
    return False, "driving"


def outlook_values(outlook: Outlook, strategy: Strategy) -> dict[str, object]:
    """Numbers for `diagnostics`; a time that is never reached is NaN."""
    return {
        "state": outlook.state,
        "action": outlook.action.name.lower(),
        "elapsed_s": outlook.elapsed_s,
        "arrival_probability": outlook.probability,
        "median_remaining_s": _or_nan(outlook.law.quantile_s(HALF)),
        "most_remaining_s": _or_nan(outlook.law.quantile_s(MOST)),
        "periods_without_progress": outlook.periods_without_progress,
        "trapped": outlook.trapped,
        "n_trap_states": len(strategy.traps.states),
        "transferred": strategy.transferred,
    }


def traps_in_words(traps: Traps) -> str:
    """How many states are traps, and of which kind; empty when none is."""
    if not len(traps.states):
        return ""
    looping, unlikely = int(traps.looping.sum()), int(traps.unlikely.sum())
    return (
        f"{len(traps.states)} of {len(traps.looping)} cells are traps: from {looping} the arrows "
        f"never lead to the goal, from {unlikely} it is reached in time with less than "
        f"{TRAP_PROBABILITY:.0%}"
    )


def _or_nan(time_s: float | None) -> float:
    return float("nan") if time_s is None else time_s
