"""The parts of a scenario that a map shows, as plain polygons in metres."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from sim.scenario.scenario import Scenario


@dataclass(frozen=True, eq=False)
class HallwayLayout:
    """What is drawn under every map; each polygon is (n, 2) corners in metres.

    outline_m: walkable area; obstacles_m: solids in it; goal_area_m; start_areas_m: (name, polygon)
    pairs; robot_radius_m.
    """

    outline_m: FloatArray
    obstacles_m: tuple[FloatArray, ...]
    goal_area_m: FloatArray
    start_areas_m: tuple[tuple[str, FloatArray], ...]
    robot_radius_m: float

    @property
    def bounds_m(self) -> tuple[float, float, float, float]:
        """(x_min, y_min, x_max, y_max) of the walkable area."""
        low, high = self.outline_m.min(axis=0), self.outline_m.max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def layout_of(scenario: Scenario) -> HallwayLayout:
    """The drawn parts of a scenario."""
    outline, *obstacles = scenario.wall_polygons_m
    return HallwayLayout(
        outline_m=outline,
        obstacles_m=tuple(obstacles),
        goal_area_m=np.array(scenario.goal_area_m),
        start_areas_m=tuple(
            (name, np.array(corners)) for name, corners in scenario.start_areas_m.items()
        ),
        robot_radius_m=scenario.robot.radius_m,
    )
