"""What a scenario must fulfil as a whole; each rule raises a ValueError that names key and fix."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from serd_bag.errors import shortened
from serd_core.arrays import BoolArray, FloatArray
from serd_files.yaml_config import dotted
from serd_sim.crowd.routes import offset_loop
from serd_sim.errors import SimError
from serd_sim.scenario.polygon import (
    Point,
    WalkableCells,
    contains,
    distance_to_segments_m,
    edges_of,
    first_crossing,
    overlap,
    signed_wall_distance_m,
)
from serd_sim.scenario.settings import LARGEST_NUMBER, LidarSettings, Loop, RobotSettings

#: Weidmann (1993).
DENSITY_AT_WHICH_NOBODY_WALKS_PM2 = 5.4
#: A robot starts within this share of a cell from the cell's centre, along either axis.
START_SPREAD = 0.2
#: People's steps stay shorter than what walls hold them off by.
LONGEST_CONTROL_PERIOD_S = 0.2
#: Of control and decision: shorter ones divide a drive into more than can be handled.
LEAST_PERIOD_S = 0.001
#: Cells of the decision grid, walkable or not, that learning and planning can still handle.
MOST_CELLS = 40_000


def require_finite_scale(values: Any, place: tuple[str | int, ...] = ()) -> None:
    """No number of the file may be so large that computing with it overflows."""
    if isinstance(values, Mapping):
        for key, value in values.items():
            require_finite_scale(value, (*place, str(key)))
    elif isinstance(values, (list, tuple)):
        for number, value in enumerate(values):
            require_finite_scale(value, (*place, number))
    elif isinstance(values, (int, float)) and abs(values) > LARGEST_NUMBER:
        raise ValueError(
            f"{dotted(place)} must be at most {LARGEST_NUMBER:g} in size, got"
            f" {shortened(repr(values))}; correct it"
        )


def require_whole_periods(name: str, period_s: float, control_period_s: float) -> None:
    """A time must be a whole number of control periods."""
    ratio = period_s / control_period_s
    if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-9 * ratio:
        raise ValueError(
            f"{name} must be a whole number of control_period_s ({control_period_s:g} s)"
            f", got {period_s:g} s"
        )


def require_control_period(control_period_s: float, robot: RobotSettings) -> None:
    """No one may get past a wall within one period, nor may people leap."""
    speed_mps = max(robot.max_vel_x_mps, -robot.min_vel_x_mps)
    too_long_s = robot.radius_m / speed_mps
    if control_period_s > LONGEST_CONTROL_PERIOD_S or control_period_s >= too_long_s:
        raise ValueError(
            f"control_period_s must be at most {LONGEST_CONTROL_PERIOD_S:g} s, and below the "
            f"{too_long_s:.3g} s in which the robot drives its own radius at "
            f"{speed_mps:g} m/s, got {control_period_s:g} s; lower it"
        )


def require_braking(robot: RobotSettings) -> None:
    """Planners brake as they accelerate, so the robot must be able to."""
    if robot.decel_lim_x_mps2 < robot.acc_lim_x_mps2:
        raise ValueError(
            f"robot.decel_lim_x_mps2 must be at least robot.acc_lim_x_mps2"
            f" ({robot.acc_lim_x_mps2:g}), with which planners brake, got"
            f" {robot.decel_lim_x_mps2:g}; raise it or lower robot.acc_lim_x_mps2"
        )


def require_longer(name: str, time_s: float, control_period_s: float) -> None:
    """Nothing ends within a control period."""
    if time_s < control_period_s:
        raise ValueError(
            f"{name} must be at least control_period_s ({control_period_s:g} s), got {time_s:g} s;"
            " raise it"
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


def require_walkable_crowd(count: int, cells: WalkableCells) -> None:
    """People must have room to walk."""
    area_m2 = float(cells.walkable.sum()) * cells.cell_size_m**2
    most = math.floor(DENSITY_AT_WHICH_NOBODY_WALKS_PM2 * area_m2)
    if count > most:
        raise ValueError(
            f"pedestrians.count must be at most {most} on {area_m2:.4g} m2, for at "
            f"{DENSITY_AT_WHICH_NOBODY_WALKS_PM2:g} people per m2 walking stops, got "
            f"{count}; lower it"
        )


def require_standing(
    name: str, place: Point, walls_m: Sequence[Sequence[Point]], radius_m: float
) -> None:
    """People stand clear of the walls: the outline of the area, then the obstacles."""
    gap_m = float(signed_wall_distance_m(np.array([place]), walls_m)[0]) - radius_m
    if gap_m < 0.0:
        raise ValueError(
            f"{name} must be at least {radius_m:g} m from every wall, got {list(place)}, "
            f"{-gap_m:.2g} m too near; move it"
        )


def require_outside_goal(
    name: str, area: Sequence[Point], goal: Sequence[Point], cells: WalkableCells
) -> None:
    """A robot must not start in the goal."""
    inside = cells.centers_m[contains(area, cells.centers_m)]
    spread_m = START_SPREAD * cells.cell_size_m * np.array([-1.0, 0.0, 1.0])
    offsets_m = np.stack(np.meshgrid(spread_m, spread_m), axis=-1).reshape(-1, 2)
    starts_m = (inside[:, None] + offsets_m).reshape(-1, 2)
    in_goal = contains(goal, starts_m).reshape(len(inside), -1).any(axis=1)
    if in_goal.any():
        raise ValueError(
            f"{name} must keep clear of goal_area_m, but a robot that starts in the cell at "
            f"{inside[np.argmax(in_goal)].tolist()} is there at once; move one of them"
        )


def require_lidar(lidar: LidarSettings, control_period_s: float) -> None:
    """Scans must fall on control ticks, and ranges must be between the limits."""
    require_whole_periods("the period of lidar.rate_hz", 1.0 / lidar.rate_hz, control_period_s)
    if not lidar.range_min_m < lidar.range_max_m:
        raise ValueError(
            f"lidar.range_min_m must be below lidar.range_max_m ({lidar.range_max_m:g})"
            f", got {lidar.range_min_m:g}; lower it"
        )


def require_in_place(outline_m: Sequence[Point], solids_m: Sequence[tuple[Point, ...]]) -> None:
    """Every obstacle must stand at least partly in the walkable area."""
    for number, solid in enumerate(solids_m):
        if not overlap(outline_m, solid):
            raise ValueError(
                f"obstacles[{number}].outline_m must lie in the walkable area"
                f", got {_listed(solid)}; move it or leave it out"
            )


def require_cells(name: str, area: Sequence[Point], cells: WalkableCells) -> None:
    """An area must hold the centre of a walkable cell."""
    if not contains(area, cells.centers_m).any():
        raise ValueError(
            f"{name} must hold the centre of at least one walkable cell of {cells.cell_size_m} m"
            f", got {_listed(area)}; enlarge or move it"
        )


def require_room(
    name: str, area: Sequence[Point], cells: WalkableCells, walls_m: FloatArray, radius_m: float
) -> None:
    """A start area must have a cell in which the robot touches no wall."""
    inside = cells.centers_m[contains(area, cells.centers_m)]
    if not has_room(inside, cells.cell_size_m, walls_m, radius_m).any():
        raise ValueError(
            f"{name} must have a cell with room for the robot, whose robot.radius_m is {radius_m:g}"
            f", got {_listed(area)}; move it away from the walls or make the robot smaller"
        )


def has_room(
    centers_m: FloatArray, cell_size_m: float, walls_m: FloatArray, radius_m: float
) -> BoolArray:
    """(N,) whether a robot that starts in the cell of each centre is clear of all walls."""
    clearance = distance_to_segments_m(centers_m, walls_m).min(axis=1)
    roomy: BoolArray = clearance - START_SPREAD * cell_size_m >= radius_m
    return roomy


def require_way(
    name: str, start: Sequence[Point], goal: Sequence[Point], cells: WalkableCells
) -> None:
    """From every cell of a start area, moves from cell to cell must lead to the goal."""
    linked = _linked_to(contains(goal, cells.centers_m), cells.walkable)
    cut_off = contains(start, cells.centers_m) & ~linked
    if cut_off.any():
        raise ValueError(
            f"goal_area_m must be reachable from {name}, but no way over cells of "
            f"{cells.cell_size_m:g} m leads there from"
            f" {cells.centers_m[np.argmax(cut_off)].tolist()}; open one"
        )


def require_lane(
    name: str,
    loop: Loop,
    outline_m: Sequence[Point],
    solids_m: Sequence[tuple[Point, ...]],
    walls_m: FloatArray,
) -> None:
    """A loop must have distinct waypoints and no hairpin, and its whole lane must be walkable."""
    line = np.array(loop.waypoints_m)
    _require_walkable(f"{name}.waypoints_m", "move it", line, outline_m, solids_m, walls_m)
    for side in (-1.0, 1.0):
        try:
            edge = offset_loop(line, side * loop.lane_half_width_m)
        except SimError as error:
            raise ValueError(f"{name}.waypoints_m: {error}") from None
        fix = f"lower lane_half_width_m ({loop.lane_half_width_m:g}) or move the loop"
        _require_walkable(
            f"the edge of the lane of {name}", fix, edge, outline_m, solids_m, walls_m
        )


def _require_walkable(
    what: str,
    fix: str,
    line_m: FloatArray,
    outline_m: Sequence[Point],
    solids_m: Sequence[tuple[Point, ...]],
    walls_m: FloatArray,
) -> None:
    walkable = contains(outline_m, line_m)
    for solid in solids_m:
        walkable &= ~contains(solid, line_m)
    if not walkable.all():
        outside = line_m[int(np.argmin(walkable))].round(3)
        raise ValueError(f"{what} must be in the walkable area, got {outside.tolist()}; {fix}")
    crossing = first_crossing(edges_of(line_m), walls_m)
    if crossing is not None:
        start, end = edges_of(line_m)[crossing[0]].round(3).tolist()
        raise ValueError(
            f"{what} must cross no wall, but the leg from {start} to {end} does; {fix}"
        )


def _linked_to(goal: BoolArray, walkable: BoolArray) -> BoolArray:
    """(S,) whether moves from cell to cell join each walkable cell to one of the goal.

    `scipy.ndimage.label` would find it as well, but takes 0.2 s of every node's start to import.
    """
    reached = np.zeros_like(walkable)
    reached[walkable] = goal
    while True:
        grown = reached.copy()
        grown[1:] |= reached[:-1]
        grown[:-1] |= reached[1:]
        grown[:, 1:] |= reached[:, :-1]
        grown[:, :-1] |= reached[:, 1:]
        grown &= walkable
        if np.array_equal(grown, reached):
            return reached[walkable]
        reached = grown


def _listed(points: Sequence[Point]) -> list[list[float]]:
    return [list(point) for point in points]
