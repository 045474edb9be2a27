"""Where the local planner is asked to go next."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Waypoint:
    """A point of the map."""

    x_m: float
    y_m: float
