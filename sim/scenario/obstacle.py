"""Obstacles: solids of the place, and bodies that robot and people push, such as chairs and doors.

A movable obstacle is an upright prism of uniform density. Its pose (x_m, y_m, yaw_rad) is that of
its hinge, or of its centroid where it has none; in the scenario its yaw is 0.
"""

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
import shapely
from pydantic import model_validator

from serd_core.arrays import FloatArray
from sim.scenario.polygon import edges_of, overlap
from sim.scenario.settings import Outline, Point
from storage.settings import setting
from storage.yaml_config import StrictModel

Pose = tuple[float, float, float]
#: Rounding of corners that a file gives.
_TOLERANCE_M = 1e-6


class Obstacle(StrictModel):
    """A solid inside the walkable area."""

    name: str = setting(..., "name of the obstacle")
    outline_m: Outline = setting(..., "corners of a simple polygon, in order", unit="m")
    mass_kg: float | None = setting(
        None,
        "mass of an obstacle that can be pushed, with the physical drive; without it the obstacle"
        " is a wall",
        unit="kg",
        gt=0,
        le=1000,
    )
    hinge_m: Point | None = setting(
        None, "vertical axis round which a door turns, inside or on its outline", unit="m"
    )

    @model_validator(mode="after")
    def _pushable(self) -> "Obstacle":
        shape = shapely.Polygon(self.outline_m)
        if self.hinge_m is not None:
            if self.mass_kg is None:
                raise ValueError("mass_kg must be given where hinge_m is; add the mass of the door")
            if shape.distance(shapely.Point(self.hinge_m)) > _TOLERANCE_M:
                raise ValueError(
                    f"hinge_m must lie inside or on outline_m, got {list(self.hinge_m)}; move it"
                )
        if self.mass_kg is not None and not shape.convex_hull.equals(shape):
            raise ValueError(
                "outline_m must be convex where mass_kg is given, got"
                f" {[list(corner) for corner in self.outline_m]}; list the corners of its hull"
            )
        return self

    @property
    def centroid_m(self) -> Point:
        """Centre of the outline's area."""
        centre = shapely.Polygon(self.outline_m).centroid
        return float(centre.x), float(centre.y)

    @property
    def pose(self) -> Pose:
        """The pose in the scenario."""
        return (*(self.hinge_m or self.centroid_m), 0.0)

    @cached_property
    def corners_m(self) -> FloatArray:
        """(n, 2) corners, seen from the pose."""
        corners: FloatArray = np.array(self.outline_m) - self.pose[:2]
        return corners

    def outline_at(self, pose: Pose | FloatArray) -> FloatArray:
        """(n, 2) corners of the obstacle at a pose."""
        x_m, y_m, yaw_rad = pose
        cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
        turn = np.array([[cosine, sine], [-sine, cosine]])
        outline: FloatArray = self.corners_m @ turn + (x_m, y_m)
        return outline

    @property
    def gyration_radius_m(self) -> float:
        """Root of the polar second moment of the area about its centroid, over the area."""
        x, y = (np.array(self.outline_m) - self.centroid_m).T
        x_next, y_next = np.roll(x, -1), np.roll(y, -1)
        cross = x * y_next - x_next * y
        squares = x**2 + x * x_next + x_next**2 + y**2 + y * y_next + y_next**2
        return math.sqrt(float(cross @ squares) / 6.0 / float(cross.sum()))


def segments_at(obstacles: Sequence[Obstacle], poses: Sequence[Pose]) -> FloatArray:
    """(S, 2, 2) edges of obstacles at their poses."""
    edges = [edges_of(each.outline_at(pose)) for each, pose in zip(obstacles, poses, strict=True)]
    return np.concatenate([np.zeros((0, 2, 2)), *edges])


def require_free(
    obstacles: Sequence[Obstacle],
    drive: str,
    outline_m: Sequence[Point],
    starts: dict[str, Outline],
) -> None:
    """Movable obstacles need the physical drive, and stand where nothing else does.

    Those without hinge are clear of all others and of the walls, and all of the start areas.
    """
    for number, obstacle in enumerate(obstacles):
        if obstacle.mass_kg is None:
            continue
        name = f"obstacles[{number}]"
        if drive != "physical":
            raise ValueError(
                f"{name}.mass_kg must be left out where robot.drive is {drive}, got"
                f" {obstacle.mass_kg:g}; set robot.drive to physical"
            )
        others = [*obstacles[:number], *obstacles[number + 1 :]]
        inside = shapely.Polygon(outline_m).covers(shapely.Polygon(obstacle.outline_m))
        free = inside and not any(overlap(obstacle.outline_m, each.outline_m) for each in others)
        if obstacle.hinge_m is None and not free:
            raise ValueError(
                f"{name}.outline_m must be clear of the walls and of other obstacles, for it has"
                " mass_kg and no hinge_m; move it"
            )
        for key, area in starts.items():
            if overlap(area, obstacle.outline_m):
                raise ValueError(
                    f"{name}.outline_m must keep clear of start_areas_m.{key}, where the robot"
                    " starts; move one of them"
                )
