"""What does not change on the page: floor, walls, cells, goal, starts, sizes."""

from typing import Any

from serd_core.grid.grid import Grid
from sim.crowd.social_force import model_named
from sim.scenario.scenario import Scenario


def scene_of(scenario: Scenario, grid: Grid) -> dict[str, Any]:
    """Plain values in metres and seconds, x east and y north."""
    return {
        "type": "scene",
        "name": scenario.name,
        "bounds_m": scenario.bounds_m,
        "walls_m": [polygon.tolist() for polygon in scenario.wall_polygons_m],
        "goal_m": scenario.goal_area_m,
        "start_m": scenario.start_areas_m["train"],
        "cells_m": grid.centers_m.tolist(),
        "cell_size_m": grid.cell_size_m,
        "decision_period_s": scenario.decision_period_s,
        "robot_radius_m": scenario.robot.radius_m,
        "person_radius_m": model_named(scenario.pedestrians.model).body_radius_m,
        "scan_start_rad": scenario.lidar.angle_min_rad,
        "scan_step_rad": scenario.lidar.angle_increment_rad,
    }
