"""What a scenario must fulfil as a whole; each rule raises a ValueError that names key and fix."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import shapely

from serd_bag.errors import shortened
from serd_core.arrays import BoolArray, FloatArray
from serd_files.yaml_config import dotted
from serd_sim.crowd.routes import offset_loop
from serd_sim.crowd.social_force import model_named
from serd_sim.errors import SimError
from serd_sim.scenario.cells import groups_of, narrowest
from serd_sim.scenario.place import LONGEST_CONTROL_PERIOD_S, MOST_CELLS, Place
from serd_sim.scenario.polygon import (
    Point,
    contains,
    distance_to_segments_m,
    edges_of,
    first_crossing,
    overlap,
    signed_wall_distance_m,
)
from serd_sim.scenario.settings import LARGEST_NUMBER

#: Weidmann (1993).
DENSITY_AT_WHICH_NOBODY_WALKS_PM2 = 5.4
#: A robot starts within this share of a cell from the cell's centre, along either axis.
START_SPREAD = 0.2


def require_consistent(scenario: Place) -> None:
    """ValueError where the parts of a scenario do not fit together."""
    _require_finite_scale(scenario.model_dump())
    _require_motion(scenario)
    _require_lidar(scenario)
    scenario.local_planner.require_within(scenario.robot, scenario.control_period_s)
    if "train" not in scenario.start_areas_m:
        raise ValueError(f"start_areas_m must have 'train', got {sorted(scenario.start_areas_m)}")
    for number, solid in enumerate(scenario.solids_m):
        if not overlap(scenario.walkable_area_m, solid):
            raise ValueError(
                f"obstacles[{number}].outline_m must lie in the walkable area"
                f", got {_listed(solid)}; move it or leave it out"
            )
    require_cell_count(scenario.walkable_area_m, scenario.cell_size_m)
    if not scenario.cells.walkable.any():
        raise ValueError(
            f"robot.radius_m must leave room in walkable_area_m, where no place is"
            f" {scenario.needs_m:g} m from all walls, got {scenario.robot.radius_m:g}; lower it"
        )
    _require_cells("goal_area_m", scenario.goal_area_m, scenario)
    for key, area in scenario.start_areas_m.items():
        _require_start(f"start_areas_m.{key}", area, scenario)
    _require_people(scenario)


def _require_finite_scale(values: Any, place: tuple[str | int, ...] = ()) -> None:
    """No number of the file may be so large that computing with it overflows."""
    if isinstance(values, Mapping):
        for key, value in values.items():
            _require_finite_scale(value, (*place, str(key)))
    elif isinstance(values, (list, tuple)):
        for number, value in enumerate(values):
            _require_finite_scale(value, (*place, number))
    elif isinstance(values, (int, float)) and abs(values) > LARGEST_NUMBER:
        raise ValueError(
            f"{dotted(place)} must be at most {LARGEST_NUMBER:g} in size, got"
            f" {shortened(repr(values))}; correct it"
        )


def _require_motion(scenario: Place) -> None:
    """No one gets past a wall within one control period, and the robot brakes as planners do."""
    robot, period_s = scenario.robot, scenario.control_period_s
    speed_mps = max(robot.max_vel_x_mps, -robot.min_vel_x_mps)
    too_long_s = robot.radius_m / speed_mps
    if period_s > LONGEST_CONTROL_PERIOD_S or period_s >= too_long_s:
        raise ValueError(
            f"control_period_s must be at most {LONGEST_CONTROL_PERIOD_S:g} s, and below the "
            f"{too_long_s:.3g} s in which the robot drives its own radius at "
            f"{speed_mps:g} m/s, got {period_s:g} s; lower it"
        )
    if robot.decel_lim_x_mps2 < robot.acc_lim_x_mps2:
        raise ValueError(
            f"robot.decel_lim_x_mps2 must be at least robot.acc_lim_x_mps2"
            f" ({robot.acc_lim_x_mps2:g}), with which planners brake, got"
            f" {robot.decel_lim_x_mps2:g}; raise it or lower robot.acc_lim_x_mps2"
        )
    for name in ("patience_s", "wait_s", "episode_timeout_s"):
        if getattr(scenario, name) < period_s:
            raise ValueError(
                f"{name} must be at least control_period_s ({period_s:g} s), got"
                f" {getattr(scenario, name):g} s; raise it"
            )


def _require_lidar(scenario: Place) -> None:
    """Scans must fall on control ticks, and ranges must be between the limits."""
    lidar, period_s = scenario.lidar, scenario.control_period_s
    scan_s = 1.0 / lidar.rate_hz
    ratio = scan_s / period_s
    if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-9 * ratio:
        raise ValueError(
            f"the period of lidar.rate_hz must be a whole number of control_period_s ({period_s:g}"
            f" s), got {scan_s:g} s"
        )
    if not lidar.range_min_m < lidar.range_max_m:
        raise ValueError(
            f"lidar.range_min_m must be below lidar.range_max_m ({lidar.range_max_m:g})"
            f", got {lidar.range_min_m:g}; lower it"
        )


def require_cell_count(outline_m: Sequence[Point], cell_size_m: float) -> None:
    """The decision grid must be one that can be solved."""
    corners = np.array(outline_m)
    width_m, height_m = corners.max(axis=0) - corners.min(axis=0)
    n_cells = width_m * height_m / cell_size_m**2
    if n_cells > MOST_CELLS:
        least_m = math.ceil(1000.0 * math.sqrt(width_m * height_m / MOST_CELLS)) / 1000.0
        raise ValueError(
            f"cell_size_m must make at most {MOST_CELLS} cells of the {width_m:g} m x "
            f"{height_m:g} m around walkable_area_m, got {cell_size_m:g} m, which makes "
            f"{n_cells:.3g}; raise it to {least_m:g} or more"
        )


def _require_cells(name: str, area: Sequence[Point], scenario: Place) -> FloatArray:
    """(N, 2) centres of the walkable cells in an area, which must have one."""
    centers_m = scenario.cells.centers_m
    inside = contains(area, centers_m)
    if not inside.any():
        raise ValueError(
            f"{name} must hold the centre of at least one walkable cell of {scenario.cell_size_m} m"
            f", got {_listed(area)}; enlarge or move it"
        )
    return centers_m[inside]


def _require_start(name: str, area: Sequence[Point], scenario: Place) -> None:
    """A start area has a cell for the robot, ways to the goal, and no start in it."""
    cells, goal = scenario.cells, scenario.goal_area_m
    size_m, radius_m = cells.cell_size_m, scenario.robot.radius_m
    inside = _require_cells(name, area, scenario)
    fits = scenario.cell_clearance_m is None
    if not (fits or has_room(inside, size_m, scenario.wall_segments_m, radius_m).any()):
        raise ValueError(
            f"{name} must have a cell with room for the robot, whose robot.radius_m is {radius_m:g}"
            f", got {_listed(area)}; move it away from the walls or make the robot smaller"
        )
    group = groups_of(cells.walkable)[cells.walkable]
    at_goal = contains(goal, cells.centers_m)
    cut_off = contains(area, cells.centers_m) & ~np.isin(group, group[at_goal])
    if cut_off.any():
        place = cells.middles_m[np.argmax(cut_off)]
        raise ValueError(_cut_off(name, place, cells.middles_m[at_goal], scenario))
    spread_m = START_SPREAD * size_m * np.array([-1.0, 0.0, 1.0])
    offsets_m = np.stack(np.meshgrid(spread_m, spread_m), axis=-1).reshape(-1, 2)
    starts_m = (inside[:, None] + offsets_m).reshape(-1, 2)
    in_goal = contains(goal, starts_m).reshape(len(inside), -1).any(axis=1)
    if in_goal.any():
        raise ValueError(
            f"{name} must keep clear of goal_area_m, but a robot that starts in the cell at "
            f"{inside[np.argmax(in_goal)].tolist()} is there at once; move one of them"
        )


def _cut_off(name: str, start_m: FloatArray, goals_m: FloatArray, scenario: Place) -> str:
    """Why no way over cells leads from a place to the goal."""
    text = f"goal_area_m must be reachable from {name}, but "
    ends = shapely.Point(start_m), shapely.MultiPoint(goals_m)
    gap = narrowest(scenario.walkable_area_m, scenario.solids_m, *ends, scenario.needs_m)
    if gap is None or gap[0] == 0.0 or scenario.cell_clearance_m is not None:
        return (
            f"{text}no way over cells of {scenario.cell_size_m:g} m leads there from"
            f" {start_m.round(3).tolist()}; open one"
        )
    width_m, (x_m, y_m) = gap
    return (
        f"{text}the way is {width_m:.2f} m wide at ({x_m:.2f}, {y_m:.2f}) m, and the robot needs"
        f" {2.0 * scenario.needs_m:.2f} m; widen it, or lower robot.radius_m"
        f" ({scenario.robot.radius_m:g})"
    )


def has_room(
    centers_m: FloatArray, cell_size_m: float, walls_m: FloatArray, radius_m: float
) -> BoolArray:
    """(N,) whether a robot that starts in the cell of each centre is clear of all walls."""
    clearance = distance_to_segments_m(centers_m, walls_m).min(axis=1)
    roomy: BoolArray = clearance - START_SPREAD * cell_size_m >= radius_m
    return roomy


def _require_people(scenario: Place) -> None:
    """People have room and loops to walk, and those who stand are clear of the walls."""
    people, cells = scenario.pedestrians, scenario.cells
    area_m2 = float(cells.walkable.sum()) * cells.cell_size_m**2
    most = math.floor(DENSITY_AT_WHICH_NOBODY_WALKS_PM2 * area_m2)
    if people.count > most:
        raise ValueError(
            f"pedestrians.count must be at most {most} on {area_m2:.4g} m2, for at "
            f"{DENSITY_AT_WHICH_NOBODY_WALKS_PM2:g} people per m2 walking stops, got "
            f"{people.count}; lower it"
        )
    if people.count and not people.loops:
        raise ValueError("pedestrians.loops must not be empty when pedestrians.count is not 0")
    radius_m = model_named(people.model).body_radius_m
    outlines_m = [scenario.walkable_area_m, *scenario.solids_m]
    for number, place in enumerate(people.standing_m):
        gap_m = float(signed_wall_distance_m(np.array([place]), outlines_m)[0]) - radius_m
        if gap_m < 0.0:
            raise ValueError(
                f"pedestrians.standing_m[{number}] must be at least {radius_m:g} m from every wall"
                f", got {list(place)}, {-gap_m:.2g} m too near; move it"
            )
    for number, loop in enumerate(people.loops):
        name, line = f"pedestrians.loops[{number}]", np.array(loop.waypoints_m)
        _require_walkable(f"{name}.waypoints_m", "move it", line, scenario)
        for side in (-1.0, 1.0):
            try:
                edge = offset_loop(line, side * loop.lane_half_width_m)
            except SimError as error:
                raise ValueError(f"{name}.waypoints_m: {error}") from None
            fix = f"lower lane_half_width_m ({loop.lane_half_width_m:g}) or move the loop"
            _require_walkable(f"the edge of the lane of {name}", fix, edge, scenario)


def _require_walkable(what: str, fix: str, line_m: FloatArray, scenario: Place) -> None:
    """A closed line (n, 2) is in the walkable area and crosses no wall."""
    walkable = contains(scenario.walkable_area_m, line_m)
    for solid in scenario.solids_m:
        walkable &= ~contains(solid, line_m)
    if not walkable.all():
        outside = line_m[int(np.argmin(walkable))].round(3)
        raise ValueError(f"{what} must be in the walkable area, got {outside.tolist()}; {fix}")
    crossing = first_crossing(edges_of(line_m), scenario.wall_segments_m)
    if crossing is not None:
        start, end = edges_of(line_m)[crossing[0]].round(3).tolist()
        raise ValueError(
            f"{what} must cross no wall, but the leg from {start} to {end} does; {fix}"
        )


def _listed(points: Sequence[Point]) -> list[list[float]]:
    return [list(point) for point in points]
