"""The headline result: one sentence with the numbers that matter most."""

from report.summary import Summary
from report.wording import counted, percent, seconds_in_words


def headline_of(summary: Summary) -> str:
    """From how many demonstrations, how many arrivals, how fast, and what had been predicted."""
    learned = (
        f"After {counted(summary.n_demonstrations, 'demonstration')} the robot reached the goal in "
        f"{summary.n_arrived} of {counted(summary.n_episodes, 'new episode')} "
        f"within {seconds_in_words(summary.timeout_s)} "
        f"({percent(summary.measured_arrival_probability)}; predicted "
        f"{percent(summary.predicted_arrival_probability)})"
    )
    return f"{learned}{_speed(summary)}."


def _speed(summary: Summary) -> str:
    if summary.measured_median_s is None:
        return ", fewer than half of them in time"
    measured = f", half of them within {seconds_in_words(summary.measured_median_s)}"
    if summary.predicted_median_s is None:
        return measured
    return f"{measured} (predicted {seconds_in_words(summary.predicted_median_s)})"
