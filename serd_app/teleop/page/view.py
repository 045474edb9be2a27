"""The data that the page draws: the scene once, the state of the world again and again, and what a
learned model means for each cell: direction of the policy and time of arrival.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serd_app.navigation.comparison import reasons_against_prediction, reasons_text, starts_of
from serd_app.navigation.navigator import HALF, quantile_or_nan_s
from serd_core.grid.grid import DIRECTION_VECTORS, Grid
from serd_sim.crowd.social_force import model_named
from serd_sim.drivers.strategy import Strategy
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint

# Decimals that are sent.
_CENTIMETRES, _MILLIRADIANS = 2, 3


def scene_of(scenario: Scenario, grid: Grid) -> dict[str, Any]:
    """The part that does not change, as plain values in metres and seconds, x east and y north."""
    return {
        "type": "scene",
        "name": scenario.name,
        "bounds_m": scenario.bounds_m,
        "walls_m": [polygon.tolist() for polygon in scenario.wall_polygons_m],
        "goal_m": scenario.goal_area_m,
        "start_m": scenario.start_areas_m["train"],
        "cells_m": grid.centers_m.tolist(),
        "cell_size_m": grid.cell_size_m,
        "robot_radius_m": scenario.robot.radius_m,
        "person_radius_m": model_named(scenario.pedestrians.model).body_radius_m,
        "scan_start_rad": scenario.lidar.angle_min_rad,
        "scan_step_rad": scenario.lidar.angle_increment_rad,
    }


def watched_scene_of(scenario: Scenario, grid: Grid) -> dict[str, Any]:
    """The scene of a page that only watches."""
    return {**scene_of(scenario, grid), "watch": True}


def world_state(observation: Observation, ranges_m: NDArray[np.float32] | None) -> dict[str, Any]:
    """Robot, people and scan."""
    people = np.concatenate([observation.people_position_m, observation.people_velocity_mps], 1)
    scan_m = None
    if ranges_m is not None:  # 0 where a ray hit nothing
        seen_m = np.where(np.isfinite(ranges_m), ranges_m, 0.0).astype(np.float64)
        scan_m = [round(range_m, _CENTIMETRES) for range_m in seen_m.tolist()]
    return {
        "time_s": round(observation.time_s, _CENTIMETRES),
        "robot": _rounded([*observation.pose, observation.speed_mps, observation.yaw_rate_radps]),
        "people": np.round(people, _CENTIMETRES).tolist(),
        "scan_m": scan_m,
    }


def overlay_of(strategy: Strategy) -> dict[str, Any]:
    """The layers of a solved model that a page can draw, each with a value per cell.

    shades: from 0 to 1 of `low` to `high`, None for a cell without a value; labels: the value.
    """
    n_by_time, by_time = int(strategy.by_time.sum()), ""
    if n_by_time:
        by_time = (
            f"; in {n_by_time} cells the way of least expected time, as the learned policy does not"
            " arrive"
        )
    directions = DIRECTION_VECTORS[strategy.policy.greedy].tolist()
    note = f"dot: waits{by_time}"
    policy = {"title": "Learned policy", "note": note, "directions": directions}
    return {"type": "overlay", "policy": policy, "arrival": _arrival_layer(strategy)}


def _arrival_layer(strategy: Strategy) -> dict[str, Any]:
    """By when half of all drives from each cell have arrived."""
    states = range(strategy.problem.grid.n_states)
    median_s = np.array([quantile_or_nan_s(strategy.law_of_cell(each), HALF) for each in states])
    slowest_s = float(np.nanmax(median_s, initial=0.0))
    shares = median_s / max(slowest_s, 1.0)
    reasons = reasons_against_prediction(
        n_demonstrations=strategy.file.fit.n_episodes,
        starts=starts_of(strategy, "train"),
        checks=strategy.file.checks,
    )
    notes = ["×: fewer arrive before the time-out"] if np.isnan(median_s).any() else []
    if reasons:
        notes.append(f"no prediction, because {reasons_text(reasons)}")
    kind = "Computed" if reasons else "Predicted"
    return {
        "title": f"{kind} seconds until half of all drives arrive",
        "note": "; ".join(notes),
        "low": "0 s",
        "high": f"{slowest_s:.0f} s",
        "shades": [None if np.isnan(share) else round(share, 2) for share in shares.tolist()],
        "labels": ["×" if np.isnan(each) else f"{each:.0f}" for each in median_s.tolist()],
    }


def point(waypoint: Waypoint | None) -> list[float] | None:
    """(x, y) in metres, None for none."""
    return None if waypoint is None else _rounded([waypoint.x_m, waypoint.y_m])


def _rounded(values: Sequence[float]) -> list[float]:
    return [round(float(value), _MILLIRADIANS) for value in values]
