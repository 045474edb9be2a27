"""Map figures carry the data they were given: positions, counts, arrows, traps, loops."""

from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from matplotlib import image as mpl_image
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.patches import Circle, Polygon
from matplotlib.quiver import Quiver
from matplotlib.text import Annotation

from serd_app.report.figures.hallway import draw_hallway, draw_scenario_plan
from serd_app.report.figures.maps import (
    draw_flow_map,
    draw_policy_map,
    draw_surprises,
    draw_visitation,
)
from serd_app.report.style import png_bytes, svg_bytes
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.grid import Action, Grid
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.scenario import load_scenario


def artists(figure, kind, gid):
    return [a for a in figure.axes[0].get_children() if isinstance(a, kind) and a.get_gid() == gid]


def cell_values(figure, panel=0):
    (cells,) = [a for a in figure.axes[panel].collections if isinstance(a, PatchCollection)]
    return np.ma.filled(cells.get_array(), np.nan)


@pytest.fixture
def hallway(scenario, snapshot):
    return draw_hallway(scenario, snapshot)


def test_people_robot_walls_and_areas_are_where_they_were(hallway, scenario, snapshot):
    people = [circle.center for circle in artists(hallway, Circle, "person")]
    np.testing.assert_allclose(people, snapshot.people_position_m)
    (robot,) = artists(hallway, Circle, "robot")
    np.testing.assert_allclose(robot.center, snapshot.robot_pose[:2])
    (arrows,) = artists(hallway, Quiver, "walking direction")
    drawn = np.stack([arrows.U, arrows.V], axis=1)
    np.testing.assert_allclose(drawn, 0.7 * snapshot.people_velocity_mps)
    (wall,) = artists(hallway, Polygon, "wall")
    np.testing.assert_allclose(wall.get_xy()[:-1], scenario.wall_polygons_m[0])
    for name in ("goal", "start\ntrain", "start\ntransfer"):
        assert len(artists(hallway, Polygon, f"area {name}")) == 1


def test_an_empty_hallway_is_drawn_with_its_title_inside_as_the_same_bytes(snapshot):
    none = np.zeros((0, 2))
    people = {"people_position_m": none, "people_velocity_mps": none, "robot_trail_m": none}
    empty = replace(snapshot, people_trail_m=np.zeros((0, 0, 2)), **people)
    first, second = (draw_hallway(load_scenario("t_junction"), empty) for _ in range(2))
    assert svg_bytes(first) == svg_bytes(second)
    assert b"<dc:date>" not in svg_bytes(first)
    unsaved = draw_hallway(load_scenario("t_junction"), snapshot)
    picture = mpl_image.imread(BytesIO(png_bytes(unsaved)))
    assert (picture[:3, :, :3] == 1.0).all()


def test_visitation_shows_the_counts_and_the_tracks(scenario, problem):
    counts = np.arange(problem.grid.n_states, dtype=float)
    track = np.array([[0.5, 0.5], [2.5, 4.5], [6.5, 5.0]])
    figure = draw_visitation(scenario, problem.grid, counts, [track])
    np.testing.assert_array_equal(cell_values(figure), counts)
    (line,) = [line for line in figure.axes[0].lines if line.get_gid() == "track"]
    np.testing.assert_array_equal(line.get_xydata(), track)
    assert figure.axes[0].get_title() == f"{int(counts.sum())} decisions, 1 track"


def test_policy_arrows_follow_the_greedy_actions_and_traps_are_framed(scenario, problem):
    n_states = problem.grid.n_states
    greedy = np.full(n_states, Action.EAST)
    greedy[0], greedy[1] = Action.WAIT, Action.SOUTH
    trapped = np.arange(n_states) < 2
    value = np.linspace(0.0, 1.0, n_states)
    figure = draw_policy_map(scenario, problem.grid, value, greedy, problem.goal_states, trapped)
    np.testing.assert_array_equal(cell_values(figure), value)
    (arrows,) = artists(figure, Quiver, "greedy moves")
    n_moving = n_states - 1 - len(problem.goal_states)
    assert len(arrows.U) == n_moving
    assert arrows.V[0] == pytest.approx(-0.8)
    assert set(np.round(arrows.U[1:], 6)) == {0.8}
    (waits,) = [c for c in figure.axes[0].collections if c.get_gid() == "greedy waits"]
    np.testing.assert_allclose(waits.get_offsets(), problem.grid.centers_m[:1])
    (frame,) = artists(figure, LineCollection, "trap")
    assert problem.grid.neighbours[0, Action.EAST] == 1
    # Two cells side by side have eight sides, of which the two between them are not drawn.
    assert len(frame.get_segments()) == 6
    ends_m = np.concatenate(frame.get_segments()) - problem.grid.centers_m[:2].mean(axis=0)
    around_m = np.abs(ends_m).max(axis=0) / problem.grid.cell_size_m
    assert np.all((around_m <= [1.0, 0.5]) & (around_m >= [0.9, 0.4]))
    assert "2 trap states" in figure.axes[0].get_title()


def test_flow_arrows_point_where_people_walk_and_are_red_where_the_scenario_differs(
    problem, scenario
):
    own = np.arange(problem.grid.n_states) % 4 + 1
    flow, order = own.copy(), np.linspace(0, 1, len(own))
    flow[:2], flow[2] = -1, own[2] % 4 + 1
    figure = draw_flow_map(problem.grid, flow, order, scenario=scenario, scenario_flow=own)
    (arrows,) = artists(figure, Quiver, "greedy moves")
    wanted = np.array([[0, 1], [1, 0], [0, -1], [-1, 0]])[flow[2:] - 1]
    np.testing.assert_allclose(np.sign(np.stack([arrows.U, arrows.V], axis=1).round(9)), wanted)
    colours = [tuple(colour) for colour in arrows.get_facecolor()]
    assert [colour != colours[-1] for colour in colours] == [True] + [False] * (len(flow) - 3)
    title = figure.axes[0].get_title()
    assert f"known in {len(flow) - 2} of {len(flow)} cells" in title
    assert "1 not the scenario's" in title


def test_surprising_decisions_are_arrows_to_the_cell_reached_and_circles_where_it_is_the_same():
    """The first move twice, another once, one that stays, and one that does not surprise."""
    grid = Grid((0.0, 0.0), 1.0, np.ones((2, 3), bool))
    state, following = [0, 0, 1, 4, 5], [1, 1, 4, 4, 2]
    decisions = Decisions(np.arange(5), np.zeros(5), state, np.zeros(5, int), following)
    figure = draw_surprises(grid, decisions, np.array([True] * 4 + [False]))
    arrows = artists(figure, Quiver, "surprising moves")
    assert sorted(len(each.U) for each in arrows) == [1, 1]
    thin, thick = sorted(arrows, key=lambda each: each.width)
    assert (thin.U[0], thin.V[0]) == pytest.approx((0.0, 0.8))
    assert (thick.U[0], thick.V[0]) == pytest.approx((0.8, 0.0))
    (waits,) = [c for c in figure.axes[0].collections if c.get_gid() == "surprising waits"]
    np.testing.assert_allclose(waits.get_offsets(), [grid.centers_m[4]])
    assert cell_values(figure).tolist() == [2, 1, 0, 0, 1, 1]
    assert "4 of 5 decisions surprising" in figure.axes[0].get_title()
    none = draw_surprises(grid, decisions, np.zeros(5, bool))
    assert not artists(none, Quiver, "surprising moves")


HALLWAY = load_scenario("hallway")


def loops_in(figure):
    (axes,) = figure.axes
    return [line for line in axes.get_lines() if line.get_gid() == "loop"]


@pytest.mark.parametrize("name", builtin_scenarios())
def test_every_loop_is_drawn_and_named(name):
    scenario = load_scenario(name)
    figure = draw_scenario_plan(scenario)
    loops = scenario.pedestrians.loops
    assert len(loops_in(figure)) == len(loops)
    named = [text.get_text() for text in figure.legends[0].get_texts()]
    assert all(words.startswith(loop.name) for words, loop in zip(named, loops, strict=True))
    if name == "hallway":  # loops that share a way are beside each other
        east_sides = {round(max(line.get_xdata()), 3) for line in loops_in(figure)}
        assert len(east_sides) == len(loops)


def test_on_the_east_side_people_walk_north():
    (axes,) = draw_scenario_plan(HALLWAY).axes
    arrows = [each for each in axes.texts if isinstance(each, Annotation)]
    east = [each for each in arrows if 4.0 < each.xy[0] < 5.0 and each.xy[0] == each.xyann[0]]
    assert len(east) > 4
    assert all(each.xy[1] > each.xyann[1] for each in east)


def test_odd_places_can_be_drawn():
    crowd = HALLWAY.with_pedestrian_count(0).pedestrians.model_copy(update={"loops": ()})
    figure = draw_scenario_plan(HALLWAY.model_copy(update={"pedestrians": crowd}))
    assert not figure.legends
    assert not loops_in(figure)
    assert png_bytes(figure)
    # matplotlib would take what is between dollar signs for a formula, and fail.
    assert png_bytes(draw_scenario_plan(HALLWAY.model_copy(update={"name": "$x_1^$ <b>"})))
    outline = ((0.0, 0.0), (200.0, 0.0), (200.0, 4.0), (0.0, 4.0))
    (axes,) = draw_scenario_plan(HALLWAY.model_copy(update={"walkable_area_m": outline})).axes
    assert len(axes.get_xticks()) < 20  # at every 4 m they would lie over each other
