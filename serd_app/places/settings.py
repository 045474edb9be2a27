"""Settings of a scenario that is made of a map."""

import math

from serd_files.settings import setting, setting_of
from serd_files.yaml_config import StrictModel
from serd_sim.scenario.settings import RobotSettings

_CELL_RADII, _RADII_TO_WALL, _ROUNDING_M = 2.25, 1.1, 1e-4


class PlaceSettings(StrictModel):
    """The robot that drives there, and how finely it decides."""

    robot_radius_m: float = setting_of(RobotSettings, "radius_m")
    max_speed_mps: float = setting_of(RobotSettings, "max_vel_x_mps")
    cell_size_m: float | None = setting(
        None,
        "side of the cells of decisions; by default 2.25 times the radius of the robot. Ways twice"
        " as wide as a cell are open in any case",
        unit="m",
        gt=0,
    )

    @property
    def cell_m(self) -> float:
        """Side of the cells, by default in whole centimetres."""
        return self.cell_size_m or math.ceil(100.0 * _CELL_RADII * self.robot_radius_m) / 100.0

    @property
    def clearance_m(self) -> float:
        """Least distance of the centre of a cell from walls.

        With half a cell, less 0.1 mm for rounding, no wall lies between two cells side by side but
        for a tip as thin as that, and each way twice as wide as a cell has cells in it. The robot
        needs its radius and room for its controller.
        """
        least_m = max(0.5 * self.cell_m - _ROUNDING_M, _RADII_TO_WALL * self.robot_radius_m)
        return round(least_m, 4)
