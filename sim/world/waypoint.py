"""Waypoints, the decision clock, and the waypoint of each decision on the grid."""

from dataclasses import dataclass

from serd_core.grid.grid import Action, Grid
from sim.scenario.scenario import Scenario
from sim.world.observation import Observation


@dataclass(frozen=True)
class Waypoint:
    """A point of the map."""

    x_m: float
    y_m: float


def is_decision_tick(observation: Observation, scenario: Scenario) -> bool:
    """Whether a decision period begins at this observation."""
    return observation.tick % scenario.ticks_per_decision == 0


def waypoint_of_cell(grid: Grid, state: int) -> Waypoint:
    """Centre of a state's cell."""
    x_m, y_m = grid.centers_m[state]
    return Waypoint(x_m=float(x_m), y_m=float(y_m))


def waypoint_of_intent(grid: Grid, observation: Observation, action: Action) -> Waypoint:
    """Centre of the neighbouring cell in the chosen direction; where the robot is, to wait.

    Towards a wall it is the centre of the robot's own cell.
    """
    here = grid.state_at(observation.x_m, observation.y_m)
    if action == Action.WAIT or here < 0:
        return Waypoint(x_m=observation.x_m, y_m=observation.y_m)
    return waypoint_of_cell(grid, int(grid.neighbours[here, action]))
