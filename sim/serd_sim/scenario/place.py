"""The place, its walkers, the robot and its task, as a scenario file has them (metres, seconds).

The walkable area is one simple polygon; its edges and those of the obstacles are the walls.
"""

from functools import cached_property

import numpy as np

from serd_core.arrays import FloatArray
from serd_files.settings import setting
from serd_files.yaml_config import StrictModel
from serd_sim.planning.settings import PlannerSettings
from serd_sim.scenario.cells import (
    WALL_MARGIN_M,
    WalkableCells,
    cells_for_footprint,
    cells_with_clearance,
)
from serd_sim.scenario.polygon import counter_clockwise, edges_of, without_straight_corners
from serd_sim.scenario.settings import (
    LidarSettings,
    Obstacle,
    OdometrySettings,
    Outline,
    PedestrianSettings,
    RobotSettings,
)

#: People's steps stay shorter than what walls hold them off by.
LONGEST_CONTROL_PERIOD_S = 0.2
#: Of control and decision: shorter ones divide a drive into more than can be handled.
LEAST_PERIOD_S = 0.001
#: Cells of the decision grid, walkable or not, that learning and planning can still handle.
MOST_CELLS = 40_000


class Place(StrictModel):
    """The values of a scenario, and its walls and cells; `rules` has what they must fulfil."""

    name: str = setting(..., "name in titles and tables")
    description: str = setting("", "one line for `serd scenario list`")
    cell_size_m: float = setting(
        1.0,
        f"side of the cells of the decision grid, of which there may be {MOST_CELLS:,}",
        unit="m",
        ge=0.001,
    )
    cell_clearance_m: float | None = setting(
        None,
        "least distance of a walkable cell's centre to every wall; by default cells are walkable in"
        " which the robot fits",
        unit="m",
        ge=0,
    )
    patience_s: float = setting(
        4.0,
        "time after which a decision that leads to no other cell ends, with the outcome to stay;"
        " more than an unhindered robot needs for a cell",
        unit="s",
        gt=0,
    )
    wait_s: float = setting(1.0, "length of a decision to wait", unit="s", gt=0)
    control_period_s: float = setting(
        0.05,
        f"time between commands, at most {LONGEST_CONTROL_PERIOD_S:g} s; the robot must drive"
        " less than its radius in it",
        unit="s",
        ge=LEAST_PERIOD_S,
    )
    episode_timeout_s: float = setting(
        420.0, "simulated time after which an episode ends without arrival", unit="s", gt=0
    )
    walkable_area_m: Outline = setting(
        ..., "corners of a simple polygon, in order; its edges are walls", unit="m"
    )
    obstacles: tuple[Obstacle, ...] = setting(
        (), "solids in it, each with `name` and `outline_m`; they may extend beyond the walls"
    )
    goal_area_m: Outline = setting(
        ...,
        "polygon; an episode ends when the robot's centre, or that of its cell, is inside",
        unit="m",
    )
    start_areas_m: dict[str, Outline] = setting(
        ...,
        "polygons by name, one of them `train`; choose another with `--start-area` or"
        " `start_area:=`",
        unit="m",
    )
    pedestrians: PedestrianSettings = PedestrianSettings()
    robot: RobotSettings = RobotSettings()
    lidar: LidarSettings = LidarSettings()
    odometry: OdometrySettings = OdometrySettings()
    local_planner: PlannerSettings = PlannerSettings()

    @property
    def patience_remark(self) -> str:
        """That the robot cannot cross a cell within the patience; else empty."""
        planned_mps = self.local_planner.max_vel_x
        speed_mps = self.robot.max_vel_x_mps if planned_mps is None else planned_mps
        reach_m = speed_mps * self.patience_s
        if reach_m >= self.cell_size_m:
            return ""
        return (
            f"at its full speed of {speed_mps:g} m/s the robot drives {reach_m:.3g} m within"
            f" patience_s = {self.patience_s:g} s, less than a cell of {self.cell_size_m:g} m:"
            " raise patience_s or the speed, or lower cell_size_m"
        )

    @property
    def ticks_per_scan(self) -> int:
        """Control periods between two scans."""
        return max(1, round(1.0 / (self.lidar.rate_hz * self.control_period_s)))

    @property
    def wall_polygons_m(self) -> list[FloatArray]:
        """Outline of the walkable area, then of each obstacle, (n, 2).

        Corners are ordered so that the free side is to the left of every edge. Corners amid a
        straight wall are left out: people keep away from each edge, however a wall is cut.
        """
        outlines = (self.walkable_area_m, *self.solids_m)
        area, *solids = (
            counter_clockwise(without_straight_corners(np.array(outline))) for outline in outlines
        )
        return [area, *(solid[::-1] for solid in solids)]

    @cached_property
    def wall_segments_m(self) -> FloatArray:
        """(W, 2, 2) start and end points of all walls."""
        return np.concatenate([edges_of(polygon) for polygon in self.wall_polygons_m])

    @property
    def solids_m(self) -> list[Outline]:
        """Outlines of the obstacles."""
        return [each.outline_m for each in self.obstacles]

    @cached_property
    def cells(self) -> WalkableCells:
        """The coarse cells of the walkable area."""
        place = self.walkable_area_m, self.solids_m, self.cell_size_m
        if self.cell_clearance_m is not None:
            return cells_with_clearance(*place, self.cell_clearance_m)
        return cells_for_footprint(*place, self.needs_m)

    @property
    def needs_m(self) -> float:
        """Least distance of the robot's centre to walls: its radius and the planners' margin."""
        return self.robot.radius_m + WALL_MARGIN_M * min(1.0, self.cell_size_m)

    @property
    def bounds_m(self) -> tuple[float, float, float, float]:
        """(x_min, y_min, x_max, y_max) of the walkable area."""
        corners = np.array(self.walkable_area_m)
        low, high = corners.min(axis=0), corners.max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])
