"""Directions on the map and the actions they mean."""

import math

from serd_core.errors import SerdError
from serd_core.grid.grid import DIRECTION_VECTORS, Action


def direction_of_action(action: Action) -> tuple[float, float]:
    """(east, north) unit vector of an action, (0, 0) to wait."""
    east, north = DIRECTION_VECTORS[action]
    return float(east), float(north)


def action_of_direction(east: float, north: float) -> Action:
    """The action a direction vector means: the nearest axis, WAIT for a vector shorter than 1/2."""
    if not (math.isfinite(east) and math.isfinite(north)):
        raise SerdError(f"a direction must be finite, got ({east}, {north}); send (0, 0) to wait")
    if math.hypot(east, north) < 0.5:
        return Action.WAIT
    if abs(east) >= abs(north):
        return Action.EAST if east > 0 else Action.WEST
    return Action.NORTH if north > 0 else Action.SOUTH
