"""The data that the page draws: the scene once, the state of the world again and again, and what a
learned model means for each cell: direction of the policy, time of arrival, dynamics.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serd_app.navigation.comparison import (
    reasons_against_prediction,
    reasons_text,
    starts_of,
)
from serd_app.navigation.forecast import HALF, quantile_or_nan_s
from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.grid import DIRECTION_VECTORS, Action, Grid, Outcome
from serd_core.grid.navigation import INTENDED_OUTCOMES
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


@dataclass(frozen=True, eq=False)
class ModelOverlay:
    """directions: (S, 2) steps east and north of the greedy action, zero where it waits.

    median_s: (S,) by which half of all drives from the cell have arrived, NaN where fewer do before
    the time-out. forward: (S,) probability that the greedy action goes forward, NaN where it waits.
    forward_by_model: that of each outcome model of moves that applies somewhere. n_least_time:
    cells in which the way of least expected time is driven, as the learned policy does not arrive.
    no_prediction_because: why the times are computed and no prediction, none where they are one.
    """

    directions: IntArray
    median_s: FloatArray
    forward: FloatArray
    forward_by_model: dict[str, float]
    n_least_time: int = 0
    no_prediction_because: tuple[str, ...] = ()


def overlay_of(strategy: Strategy) -> ModelOverlay:
    """The overlay of a solved model, at the goal that it is solved for."""
    problem, greedy = strategy.problem, strategy.policy.greedy
    states = np.arange(problem.grid.n_states)
    model = problem.outcome_models.model_of[states, greedy]
    by_model = _forward_by_model(strategy)
    of_model = np.array([by_model.get(name, np.nan) for name in problem.model_names])
    return ModelOverlay(
        directions=DIRECTION_VECTORS[greedy],
        median_s=np.array(
            [quantile_or_nan_s(strategy.law_of_cell(state), HALF) for state in states.tolist()]
        ),
        forward=np.where(greedy == Action.WAIT, np.nan, of_model[model]),
        forward_by_model=by_model,
        n_least_time=int(strategy.by_time.sum()),
        no_prediction_because=reasons_against_prediction(
            n_demonstrations=strategy.file.fit.n_episodes, starts=starts_of(strategy, "train")
        ),
    )


def _forward_by_model(strategy: Strategy) -> dict[str, float]:
    problem, file = strategy.problem, strategy.file
    moves = INTENDED_OUTCOMES == Outcome.FORWARD
    used = [row for row in problem.used_models if moves[row % len(moves)]]
    column = file.outcome_names.index(Outcome.FORWARD.name.lower())
    learned = {each.name: each.learned[column] for each in file.outcome_models}
    return {name: learned[name] for name in (problem.model_names[row] for row in used)}


def overlay_message(overlay: ModelOverlay) -> dict[str, Any]:
    """The layers of a learned model that a page can draw, each with a value per cell.

    shades: from 0 to 1 of `low` to `high`, None for a cell without a value; labels: the value.
    """
    by_time = ""
    if overlay.n_least_time:
        by_time = (
            f"; in {overlay.n_least_time} cells the way of least expected time, as the learned"
            " policy does not arrive"
        )
    by_model = [
        f"{name.replace('_', ' ')} {100.0 * each:.0f} %"
        for name, each in overlay.forward_by_model.items()
    ]
    return {
        "type": "overlay",
        "policy": {
            "title": "Learned policy",
            "note": f"dot: waits{by_time}",
            "directions": overlay.directions.tolist(),
        },
        "arrival": _arrival_layer(overlay),
        "dynamics": {
            "title": "Probability (%) that a move of the policy goes forward",
            "note": f"all moves: {', '.join(by_model)}",
            "low": "0 %",
            "high": "100 %",
            "shades": _shades(overlay.forward),
            "labels": _labels(100.0 * overlay.forward, ""),
        },
    }


def _arrival_layer(overlay: ModelOverlay) -> dict[str, Any]:
    slowest_s = float(np.nanmax(overlay.median_s, initial=0.0))
    notes = ["×: fewer arrive before the time-out"] if np.isnan(overlay.median_s).any() else []
    if overlay.no_prediction_because:
        notes.append(f"no prediction, because {reasons_text(overlay.no_prediction_because)}")
    kind = "Computed" if overlay.no_prediction_because else "Predicted"
    return {
        "title": f"{kind} seconds until half of all drives arrive",
        "note": "; ".join(notes),
        "low": "0 s",
        "high": f"{slowest_s:.0f} s",
        "shades": _shades(overlay.median_s / max(slowest_s, 1.0)),
        "labels": _labels(overlay.median_s, "×"),
    }


def _shades(shares: NDArray[np.float64]) -> list[float | None]:
    return [None if np.isnan(share) else round(share, 2) for share in shares.tolist()]


def _labels(values: NDArray[np.float64], without: str) -> list[str]:
    """Whole numbers; without: in place of NaN."""
    return [without if np.isnan(value) else f"{value:.0f}" for value in values.tolist()]


def point(waypoint: Waypoint | None) -> list[float] | None:
    """(x, y) in metres, None for none."""
    return None if waypoint is None else _rounded([waypoint.x_m, waypoint.y_m])


def _rounded(values: Sequence[float]) -> list[float]:
    return [round(float(value), _MILLIRADIANS) for value in values]
