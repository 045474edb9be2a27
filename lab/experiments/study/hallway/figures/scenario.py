"""Fig. 5.6: the scenario with its people, the shortest way, and the way experts typically take."""

from itertools import combinations

import numpy as np
import pandas as pd
import scipy.sparse
import scipy.sparse.csgraph
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lab.experiments.study.hallway.tables.results import Results
from lab.experiments.study.recordings.demonstrations import load_sets
from lab.experiments.study.recordings.experts import PEOPLE
from lab.experiments.study.study import Study
from serd_app.report import style
from serd_app.report.figures.map_axes import draw_areas, draw_vectors, map_figure
from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.grid import Grid
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.world import HallwayWorld

SHORTEST, TYPICAL, PERSON = "shortest way", "typical way", "person"
_COLUMNS = ["x_m", "y_m", "vx_mps", "vy_mps"]
_ORANGE = "#e07b00"
_ARROW_S = 0.6


def rows(results: Results) -> pd.DataFrame:
    """Corners of both ways in order; people with their velocities at the start of episode 0."""
    grid = results.problem.grid
    training = load_sets(results, PEOPLE, 0).training
    typical = typical_way(grid, training)
    goal_m = _nearest_goal(results, typical[0])
    radius_m = results.scenario.robot.radius_m
    ways = {
        SHORTEST: shortest_way(results.scenario, typical[0], goal_m, radius_m),
        TYPICAL: typical,
    }
    with HallwayWorld(results.scenario, seed=results.settings.seed) as world:
        seen = world.reset(0, "train")
    people = np.concatenate([seen.people_position_m, seen.people_velocity_mps], axis=1)
    tables = []
    for kind, numbers in (ways | {PERSON: people}).items():
        table = pd.DataFrame({"kind": kind, "number": np.arange(len(numbers))})
        table[_COLUMNS] = np.pad(numbers, ((0, 0), (0, 4 - numbers.shape[1])))  # ways: no velocity
        tables.append(table)
    return pd.concat(tables)


def typical_way(grid: Grid, decisions: Decisions) -> FloatArray:
    """(n, 2) the demonstration whose cells are most like those of all others (a medoid)."""
    tracks = {
        episode: decisions.state[decisions.episode == episode] for episode in decisions.episodes
    }
    visits = np.zeros((len(tracks), grid.n_states))
    for number, states in enumerate(tracks.values()):
        visits[number, states] = 1.0
    shared = visits @ visits.T
    united = visits.sum(axis=1)[:, None] + visits.sum(axis=1)[None, :] - shared
    most_alike = int((shared / united).sum(axis=1).argmax())
    episode = list(tracks)[most_alike]
    last = decisions.next_state[decisions.episode == episode][-1:]
    return np.asarray(grid.centers_m[np.concatenate([tracks[episode], last])])


def draw(table: pd.DataFrame, study: Study) -> Figure:
    """The map with areas, people and both ways."""
    with style.report_style():
        figure, (axes,) = map_figure(study.scenario, height_in=7.6, width_in=6.6)
        draw_areas(axes, study.scenario, filled=True)
        _draw_people(axes, _points(table, PERSON))
        for kind, colour, line in ((TYPICAL, style.PURPLE, "-"), (SHORTEST, _ORANGE, "--")):
            way = _points(table, kind)[:, :2]
            axes.plot(*way.T, color=colour, linestyle=line, linewidth=2.6, zorder=9, alpha=0.9)
            tail = way[-1] - 0.4 * (way[-1] - way[-2]) / np.linalg.norm(way[-1] - way[-2])
            arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 2.2}
            axes.annotate("", xy=way[-1], xytext=tail, arrowprops=arrow, zorder=9)
        count = len(_points(table, PERSON))
        axes.set_title(f"{study.scenario.name} with {count} people")
        figure.legend(handles=_legend(), loc="outside lower center", ncols=2)
    return figure


def _draw_people(axes: Axes, people: FloatArray) -> None:
    axes.scatter(people[:, 0], people[:, 1], s=26, color=style.PERSON_COLOUR, zorder=8, linewidth=0)
    shift_m = people[:, 2:] * _ARROW_S
    draw_vectors(axes, people[:, :2], shift_m, width=0.013, color=style.INK, zorder=8)


def _legend() -> list[Line2D]:
    person: style.Look = {"linestyle": "none", "marker": "o", "color": style.PERSON_COLOUR}
    return [
        Line2D([], [], color=style.PURPLE, linewidth=2.6, label="typical demonstration"),
        Line2D([], [], color=_ORANGE, linestyle="--", linewidth=2.6, label="shortest way"),
        Line2D([], [], label="person, arrow = velocity", **person),
    ]


def _nearest_goal(results: Results, start_m: FloatArray) -> FloatArray:
    goals = results.problem.grid.centers_m[results.problem.goal_states]
    return np.asarray(goals[np.linalg.norm(goals - start_m, axis=1).argmin()])


def _points(table: pd.DataFrame, kind: str) -> FloatArray:
    return np.asarray(table.loc[table["kind"] == kind, _COLUMNS])


def shortest_way(
    scenario: Scenario, start_m: FloatArray, goal_m: FloatArray, clearance_m: float
) -> FloatArray:
    """(n, 2) corners of the shortest way that keeps a clearance from the outer corners."""
    outline, *obstacles = map(shapely.Polygon, scenario.wall_polygons_m)
    floor = outline - shapely.union_all(obstacles)
    offsets = clearance_m * np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])
    corners = np.array(scenario.walkable_area_m, dtype=np.float64)
    # Places diagonally off every corner that are on the floor.
    places = (corners[:, None] + offsets).reshape(-1, 2)
    places = places[shapely.contains_xy(floor, places)]
    points = np.array([start_m, goal_m, *places])
    legs = np.array(list(combinations(range(len(points)), 2)))
    legs = legs[shapely.covers(floor, shapely.linestrings(points[legs]))]
    length_m = np.linalg.norm(points[legs[:, 0]] - points[legs[:, 1]], axis=1)
    graph = scipy.sparse.csr_array((length_m, tuple(legs.T)), shape=(len(points),) * 2)
    _, before = scipy.sparse.csgraph.dijkstra(
        graph, directed=False, indices=0, return_predecessors=True
    )
    way = [1]
    while way[-1] != 0 and before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    return points[way[::-1]]
