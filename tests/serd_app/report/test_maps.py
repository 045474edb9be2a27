"""Map figures carry the data they were given: positions, counts, arrows, traps, loops."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.patches import Polygon
from matplotlib.quiver import Quiver

from serd_app.report.maps import (
    draw_flow_map,
    draw_policy_map,
    draw_scenario_plan,
    draw_visitation,
)
from serd_app.report.style import svg_bytes
from serd_core.grid.grid import Action
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.scenario import load_scenario


def artists(figure, kind, gid):
    return [a for a in figure.axes[0].get_children() if isinstance(a, kind) and a.get_gid() == gid]


def cell_values(figure, panel=0):
    (cells,) = [a for a in figure.axes[panel].collections if isinstance(a, PatchCollection)]
    return np.ma.filled(cells.get_array(), np.nan)


def test_visitation_shows_the_counts_and_the_tracks(scenario, problem):
    counts = np.arange(problem.grid.n_states, dtype=float)
    track = np.array([[0.5, 0.5], [2.5, 4.5], [6.5, 5.0]])
    figure = draw_visitation(scenario, problem.grid, counts, [track])
    np.testing.assert_array_equal(cell_values(figure), counts)
    (line,) = [line for line in figure.axes[0].lines if line.get_gid() == "track"]
    np.testing.assert_array_equal(line.get_xydata(), track)
    assert figure.axes[0].get_title() == f"{int(counts.sum())} decisions, 1 track"
    (wall,) = artists(figure, Polygon, "wall")
    np.testing.assert_allclose(wall.get_xy()[:-1], scenario.wall_polygons_m[0])
    for name in ("goal", "start\ntrain", "start\ntransfer"):
        assert len(artists(figure, Polygon, f"area {name}")) == 1
    assert svg_bytes(figure) == svg_bytes(draw_visitation(scenario, problem.grid, counts, [track]))


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


def test_the_name_of_an_area_at_a_wall_stands_outside_in_the_middle_of_its_room():
    figure = draw_scenario_plan(load_scenario("hallway"))
    places_m = {text.get_text(): text.get_position() for text in figure.axes[0].texts}
    assert places_m["start train"] == pytest.approx((1.0, -0.2))
    assert places_m["goal"] == pytest.approx((12.0, 15.8))
