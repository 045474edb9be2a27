"""The plan of a scenario shows all areas and the people's loops."""

import pytest
from matplotlib.lines import Line2D
from matplotlib.text import Annotation

from serd_app.report.figures.hallway import draw_scenario_plan
from serd_app.report.style import png_bytes
from serd_sim.scenario.scenario import builtin_scenarios, load_scenario

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


def test_loops_that_share_a_way_are_drawn_beside_each_other():
    east_sides = [max(line.get_xdata()) for line in loops_in(draw_scenario_plan(HALLWAY))]
    assert len({round(x, 3) for x in east_sides}) == len(east_sides)


@pytest.mark.parametrize(("convention", "northwards"), [("right_hand", True), ("left_hand", False)])
def test_on_the_east_side_people_walk_north_where_traffic_keeps_right(convention, northwards):
    (axes,) = draw_scenario_plan(HALLWAY.model_copy(update={"flow_convention": convention})).axes
    arrows = [each for each in axes.texts if isinstance(each, Annotation)]
    east = [each for each in arrows if 4.0 < each.xy[0] < 5.0 and each.xy[0] == each.xyann[0]]
    assert len(east) > 4
    assert all((each.xy[1] > each.xyann[1]) == northwards for each in east)


def test_a_place_without_people_has_no_legend_and_can_be_drawn():
    empty = HALLWAY.with_pedestrian_count(0)
    empty = empty.model_copy(
        update={"pedestrians": empty.pedestrians.model_copy(update={"loops": ()})}
    )
    figure = draw_scenario_plan(empty)
    assert not figure.legends
    assert not any(isinstance(each, Line2D) for each in loops_in(figure))
    assert png_bytes(figure) == png_bytes(draw_scenario_plan(empty))


def test_a_name_with_dollar_signs_is_no_formula():
    """matplotlib would take what is between them for one, and fail."""
    assert png_bytes(draw_scenario_plan(HALLWAY.model_copy(update={"name": "$x_1^$ <b>"})))


def test_the_axes_of_a_long_place_have_few_numbers():
    """At every 4 m they would lie over each other."""
    outline = ((0.0, 0.0), (200.0, 0.0), (200.0, 4.0), (0.0, 4.0))
    (axes,) = draw_scenario_plan(HALLWAY.model_copy(update={"walkable_area_m": outline})).axes
    assert len(axes.get_xticks()) < 20
