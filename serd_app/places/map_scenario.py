"""A scenario file from an area: its walls, cells, a goal and a start far apart, the robot."""

import json
import math
from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from scipy.ndimage import label
from scipy.sparse import csr_array
from scipy.sparse.csgraph import shortest_path

from serd_app.errors import AppError
from serd_app.places.free_area import largest, outline_of_cells, rings_m
from serd_app.places.settings import PlaceSettings
from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.grid.grid import Grid
from serd_files.errors import USER_ERRORS
from serd_files.yaml_config import yaml_model
from serd_sim.scenario.cells import cells_with_clearance
from serd_sim.scenario.grid import cell_area_m, goal_cell, grid_of
from serd_sim.scenario.place import MOST_CELLS
from serd_sim.scenario.polygon import contains, edges_of
from serd_sim.scenario.rules import has_room, require_cell_count
from serd_sim.scenario.scenario import Scenario
from serd_sim.scenario.settings import RobotSettings

#: Cells along a side of the areas of goal and start.
_AREA_CELLS = 3
_SHORTEST_TIMEOUT_S = 60.0
#: Of the time for the way at full speed.
_TIMEOUT_WAYS = 6.0
_PATIENCE_CELLS = 3.0
Corners = Sequence[tuple[float, float]]
_TEXT = """\
# {source}.
# Every key may be edited, docs/scenario_keys.yaml has them all; `serd scenario show FILE` draws it.
name: {name}
description: {description}

# The grid of decisions. Cells are walkable where their centre is at least
# cell_clearance_m away from all walls.
cell_size_m: {cell_size_m}
{clearance}# A decision ends in another cell, or after patience_s in the same one.
patience_s: {patience_s}
wait_s: {wait_s}
control_period_s: 0.05
episode_timeout_s: {timeout_s}

# An episode ends where the robot's centre is in this polygon; `--goal x,y` takes another cell.
goal_area_m: {goal}

# Episodes begin in an area, `train` unless `--start-area` names another one.
start_areas_m:
  train: {start}

robot:
  radius_m: {radius_m}
  max_vel_x_mps: {speed_mps}
lidar:
  rate_hz: 10.0

# No people walk here yet. With people:
# pedestrians:
#   count: 10
#   loops:
#     - name: round the shelf
#       waypoints_m: [[1, 1], [4, 1], [4, 3], [1, 3]]    # in the order of right-hand traffic
#       lane_half_width_m: 0.6
pedestrians:
  count: 0

# Walls: the edges of the area and of the obstacles in it.
walkable_area_m: {outline}
obstacles:{obstacles}
"""


def map_scenario_yaml(
    area: shapely.Polygon,
    settings: PlaceSettings,
    *,
    name: str,
    source: str,
    goal_m: tuple[float, float] | None = None,
    start_m: tuple[float, float] | None = None,
) -> str:
    """The text of a scenario file for an area; AppError or SimError where no task fits into it.

    goal_m, start_m: points in the cells of goal and start; by default far from each other.
    """
    if area.is_empty:
        raise AppError(
            "the free area must be wider than 1 mm, got one that is not; correct the resolution of"
            " the map, in metres per cell"
        )
    grid = _grid_of_area(area, settings)
    goal = None if goal_m is None else goal_cell(grid, *goal_m)
    start = None if start_m is None else goal_cell(grid, *start_m, what="start")
    rooms = _rooms(grid, area, settings.robot_radius_m)
    goal, start, n_steps = _ends(grid, rooms, goal, start)
    patience_s, wait_s = (Scenario.model_fields[key].default for key in ("patience_s", "wait_s"))
    crossing_s = settings.cell_m / settings.max_speed_mps
    return _text(
        area,
        _areas(grid, goal, start),
        n_steps,
        name=name,
        source=source,
        cell_size_m=settings.cell_m,
        clearance=f"cell_clearance_m: {settings.clearance_m!r}\n",
        patience_s=max(patience_s, math.ceil(_PATIENCE_CELLS * crossing_s)),
        wait_s=wait_s,
        radius_m=settings.robot_radius_m,
        speed_mps=settings.max_speed_mps,
    )


def _grid_of_area(area: shapely.Polygon, settings: PlaceSettings) -> Grid:
    """Walkable cells with enough room around their centres; AppError where there is none."""
    outline, *solids = rings_m(area)
    cell_m, clearance_m = settings.cell_m, settings.clearance_m
    try:
        require_cell_count(outline, cell_m)
    except ValueError as error:
        raise AppError(str(error)) from None
    cells = cells_with_clearance(outline, solids, cell_m, clearance_m)
    if not cells.walkable.any():
        raise AppError(
            f"cell_size_m must leave a walkable cell, but no centre of cells of {cell_m:g} m is"
            f" {clearance_m:g} m or more from all walls; lower it or robot_radius_m"
        )
    return cells.grid


#: Name of a scenario of the cells in which a robot was.
FITTED = "fitted grid"


def grid_scenario(
    grid: Grid,
    goal_states: IntArray,
    start_states: IntArray,
    patience_s: float,
    wait_s: float,
    *,
    name: str,
) -> tuple[str, Scenario] | None:
    """Text and scenario of a place of which only a grid is known, whose cells it has exactly.

    start_states: from which episodes began; patience_s, wait_s: of their decisions. None where no
    scenario can have these cells, or no moves lead from where there is room to the goal.
    """
    if grid.walkable.size > MOST_CELLS:
        return None
    outline = outline_of_cells(grid.walkable)
    area = shapely.transform(outline, lambda each: each * grid.cell_size_m + grid.origin_m)
    cell_m, robot = grid.cell_size_m, RobotSettings()
    radius_m = min(robot.radius_m, cell_m)
    goals = _largest_group(grid, goal_states)
    boxes = [shapely.Polygon(cell_area_m(grid, int(state))) for state in goals]
    goal_area = shapely.union_all(boxes)
    rooms = _rooms(grid, area, radius_m)
    try:
        start = _usual_start(start_states, rooms, goals)
        _, start, n_steps = _ends(grid, rooms, int(goals[0]), start)
        text = _text(
            area,
            (rings_m(largest(goal_area))[0], cell_area_m(grid, start)),
            n_steps,
            name=name,
            source="The cells of a grid that was fitted to recordings",
            cell_size_m=cell_m,
            clearance=f"cell_clearance_m: {0.1 * cell_m!r}\n",
            patience_s=patience_s,
            wait_s=wait_s,
            radius_m=radius_m,
            speed_mps=max(robot.max_vel_x_mps, 2.0 * cell_m / patience_s),
        )
        found = yaml_model(text, Scenario, name=name)
    except USER_ERRORS:
        return None
    return (text, found) if grid_of(found).fingerprint() == grid.fingerprint() else None


def _usual_start(start_states: IntArray, rooms: BoolArray, goals: IntArray) -> int | None:
    """The state with room from which most episodes began, None where there is none."""
    counts = np.bincount(start_states, minlength=len(rooms)) * rooms
    counts[goals] = 0
    return int(np.argmax(counts)) if counts.any() else None


def _text(
    area: shapely.Polygon,
    goal_and_start_m: tuple[Corners, Corners],
    n_steps: int,
    *,
    name: str,
    source: str,
    cell_size_m: float,
    speed_mps: float,
    clearance: str = "",
    **values: float,
) -> str:
    """n_steps: moves from the start to the goal; values: of other keys of the text."""
    (outline, *solids), (goal_m, start_m) = rings_m(area), goal_and_start_m
    timeout_s = max(_SHORTEST_TIMEOUT_S, _TIMEOUT_WAYS * n_steps * cell_size_m / speed_mps)
    obstacles = (
        f"\n  - {{name: solid {number}, outline_m: {_flow(corners)}}}"
        for number, corners in enumerate(solids, start=1)
    )
    return _TEXT.format(
        source=source,
        name=json.dumps(name, ensure_ascii=False),
        description=json.dumps(f"{source}.", ensure_ascii=False),
        cell_size_m=cell_size_m,
        speed_mps=speed_mps,
        clearance=clearance,
        timeout_s=math.ceil(timeout_s / 10.0) * 10.0,
        goal=_flow(goal_m),
        start=_flow(start_m),
        outline=_flow(outline),
        obstacles="".join(obstacles) or " []",
        **values,
    )


def _flow(corners: Iterable[tuple[float, float]]) -> str:
    """Corners as YAML in one line."""
    return json.dumps([[float(x), float(y)] for x, y in corners])


def _ends(
    grid: Grid, rooms: BoolArray, goal: int | None, start: int | None
) -> tuple[int, int, int]:
    """(goal, start, moves from one to the other); goal and start that are not given are as far away
    as moves lead."""
    if not rooms.any():
        raise AppError(
            "robot_radius_m must leave room in a cell for the robot to start, it touches a wall in"
            " each; lower it or cell_size_m"
        )
    if goal is None:
        middle = _largest_group(grid, np.arange(grid.n_states))[0] if start is None else start
        goal = _farthest(grid, int(middle), rooms)[0]
    farthest, steps = _farthest(grid, goal, rooms)
    start = farthest if start is None else start
    if not np.isfinite(steps[start]) or start == goal:
        (x_m, y_m), (other_x_m, other_y_m) = grid.centers_m[[start, farthest]]
        fix = "mend the map, as moves lead there from no cell in which the robot has room"
        if farthest != goal and np.isfinite(steps[farthest]):
            fix = f"take --start {other_x_m:g},{other_y_m:g}, from which they do"
        raise AppError(
            f"start must be another cell than the goal, from which moves lead there, got that at"
            f" ({x_m:g}, {y_m:g}) m; {fix}"
        )
    return goal, start, int(steps[start])


def _farthest(grid: Grid, state: int, among: BoolArray) -> tuple[int, FloatArray]:
    """The state among others that most moves lead to, and (S,) moves to each, inf for none."""
    rows = np.repeat(np.arange(grid.n_states), grid.neighbours.shape[1])
    links = csr_array((np.ones(len(rows)), (rows, grid.neighbours.ravel())))
    steps = np.asarray(shortest_path(links, unweighted=True, indices=state))
    reached = np.where(among & np.isfinite(steps), steps, -1.0)
    return int(np.argmax(reached)), steps


def _areas(grid: Grid, goal: int, start: int) -> tuple[Corners, Corners]:
    """Three by three cells around goal and start; one cell where a wall is between these, or where
    the areas would touch."""
    wide = [_wide_area_m(grid, state) for state in (goal, start)]
    if np.abs(grid.cells[goal] - grid.cells[start]).max() <= 2 * _AREA_CELLS or not all(wide):
        return cell_area_m(grid, goal), cell_area_m(grid, start)
    return wide[0], wide[1]


def _wide_area_m(grid: Grid, state: int) -> Corners:
    """Empty where a wall is between its cells."""
    center = grid.centers_m[state]
    wide = np.array(cell_area_m(grid, state)) * _AREA_CELLS - (_AREA_CELLS - 1) * center
    _, steps = _farthest(grid, state, np.ones(grid.n_states, dtype=bool))
    if (steps[contains(wide, grid.centers_m)] > _AREA_CELLS - 1).any():
        return []
    return [(round(float(x), 6), round(float(y), 6)) for x, y in wide]


def _rooms(grid: Grid, area: shapely.Polygon, radius_m: float) -> BoolArray:
    walls_m = np.concatenate([edges_of(ring) for ring in rings_m(area)])
    return has_room(grid.centers_m, grid.cell_size_m, walls_m, radius_m)


def _largest_group(grid: Grid, states: IntArray) -> IntArray:
    """Those of the states that lie side by side, most of them."""
    picture = np.zeros(grid.walkable.shape, dtype=bool)
    rows, columns = grid.cells[states].T
    picture[rows, columns] = True
    labels = label(picture)[0][rows, columns]
    return np.asarray(states[labels == np.argmax(np.bincount(labels))])
