"""A scenario: the place, its walkers, the robot and its task, as one YAML file (metres, seconds).

The walkable area is one simple polygon; its edges and those of the obstacles are the walls.
"""

import hashlib
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError, model_validator

from serd_bag.files import read_text
from serd_core.arrays import FloatArray
from serd_files.settings import setting
from serd_files.yaml_config import StrictModel, load_yaml_model, sentence_of
from serd_sim.errors import SimError
from serd_sim.planning.settings import PlannerSettings
from serd_sim.scenario import rules
from serd_sim.scenario.cells import (
    WALL_MARGIN_M,
    WalkableCells,
    cells_for_footprint,
    cells_with_clearance,
)
from serd_sim.scenario.names import scenario_file
from serd_sim.scenario.polygon import (
    counter_clockwise,
    edges_of,
    without_straight_corners,
)
from serd_sim.scenario.settings import (
    LidarSettings,
    Obstacle,
    OdometrySettings,
    Outline,
    PedestrianSettings,
    RobotSettings,
)

#: What the cells of a place depend on.
_OF_CELLS = {"walkable_area_m", "obstacles", "cell_size_m", "cell_clearance_m", "robot"}


class Scenario(StrictModel):
    """Everything that defines a world except the seed."""

    name: str = setting(..., "name in titles and tables")
    description: str = setting("", "one line for `serd scenario list`")
    cell_size_m: float = setting(
        1.0,
        f"side of the cells of the decision grid, of which there may be {rules.MOST_CELLS:,}",
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
        f"time between commands, at most {rules.LONGEST_CONTROL_PERIOD_S:g} s; the robot must drive"
        " less than its radius in it",
        unit="s",
        ge=rules.LEAST_PERIOD_S,
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

    @model_validator(mode="after")
    def _consistent(self) -> "Scenario":
        rules.require_consistent(self)
        return self

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

    def model_copy(self, *, update: Any = None, deep: bool = False) -> "Scenario":
        """As of pydantic, but what is computed from the place is computed anew for another one."""
        copied = super().model_copy(update=update, deep=deep)
        if _OF_CELLS & (update or {}).keys():
            for name in ("cells", "wall_segments_m"):
                copied.__dict__.pop(name, None)
        return copied

    @property
    def bounds_m(self) -> tuple[float, float, float, float]:
        """(x_min, y_min, x_max, y_max) of the walkable area."""
        corners = np.array(self.walkable_area_m)
        low, high = corners.min(axis=0), corners.max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def with_pedestrian_count(self, count: int) -> "Scenario":
        """The same scenario with another number of people."""
        if count < 0:
            raise SimError(f"the number of people must be at least 0, got {count}; use 0 for none")
        return self.with_values("pedestrians", count=count)

    def with_values(self, part: str, **values: object) -> "Scenario":
        """The same scenario with other values in a part of it; SimError where they do not fit."""
        content = self.model_dump()
        try:
            return type(self).model_validate(content | {part: content[part] | values})
        except ValidationError as error:
            raise SimError(sentence_of(error, type(self))) from None

    def with_local_planner(self, parameters: PlannerSettings) -> "Scenario":
        """The same scenario with other parameters of the local planners."""
        try:
            parameters.require_within(self.robot, self.control_period_s)
        except ValueError as error:
            raise SimError(str(error)) from None
        return self.model_copy(update={"local_planner": parameters})


def scenario_content(scenario: Scenario) -> str:
    """All values of a scenario, and the URDF that it drives."""
    text = scenario.model_dump_json()
    if scenario.robot.drive == "physical":
        text += read_text(scenario.robot.urdf_path)
    return text


def scenario_digest(scenario: Scenario) -> str:
    """Digest of the content of a scenario."""
    return hashlib.sha256(scenario_content(scenario).encode()).hexdigest()[:12]


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Scenario by the name of a built-in one or by the path of a YAML file."""
    return load_yaml_model(scenario_file(name_or_path), Scenario)
