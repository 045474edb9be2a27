"""Where a drive without marks is cut into episodes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_app.drives.mapped.mapping import DriveMapping
from serd_app.drives.unmarked import unmarked_spans

STEP_S = 0.1


def drive(*legs, speed_mps=0.5):
    """(time_s, position_m) through the points (x, y) at that speed; a number stands so long."""
    place, rows = np.zeros(2), [np.zeros(2)]
    for leg in legs:
        if isinstance(leg, float):
            rows += [place] * round(leg / STEP_S)
            continue
        n_steps = round(np.linalg.norm(np.array(leg) - place) / speed_mps / STEP_S)
        rows += list(place + np.linspace(0, 1, n_steps + 1)[1:, None] * (np.array(leg) - place))
        place = np.array(leg, dtype=float)
    return STEP_S * np.arange(len(rows)), np.array(rows)


def spans_of(time_s, position_m, **mapping):
    spans, cuts = unmarked_spans(time_s, position_m, 0.5, DriveMapping(**mapping))
    return [(round(each.start_s, 1), round(each.end_s, 1), each.outcome) for each in spans], cuts


def test_a_round_trip_is_cut_where_it_turns():
    spans, cuts = spans_of(*drive((5, 0), (0.2, 0)))
    assert spans == [(0.0, 10.0, "arrived"), (10.0, 19.6, "arrived")]
    assert cuts == {"turn": 2}
    whole, cuts = spans_of(*drive((5, 0), (0.2, 0)), round_trips=False)
    assert (whole, cuts) == ([(0.0, 19.6, "unmarked")], {})


def test_every_lap_of_a_patrol_is_there_and_back_and_the_last_way_stays():
    spans, _ = spans_of(*drive((5, 0), (0, 0), (5, 0), (0, 0), (5, 0)))
    assert [start for start, _, _ in spans] == [0.0, 10.0, 20.0, 30.0, 40.0]
    assert spans[-1] == (40.0, 50.0, "unmarked")


def test_an_episode_ends_at_a_long_stop_and_the_next_begins_when_the_robot_moves_on():
    spans, cuts = spans_of(*drive((4, 0), 15.0, (4, 4), 3.0, (4, 5)))
    assert len(spans) == 2
    assert spans[0] == (0.0, pytest.approx(8.0, abs=1.0), "arrived")
    assert spans[1] == (pytest.approx(23.0, abs=1.0), pytest.approx(36.0), "unmarked")
    assert cuts == {"stop": 1}
    assert len(spans_of(*drive((4, 0), 15.0, (4, 4)), stop_s=None)[0]) == 1
    assert len(spans_of(*drive((4, 0), 15.0, (4, 4)), stop_s=20.0)[0]) == 1


def test_a_robot_that_never_moves_is_one_episode():
    assert spans_of(*drive(30.0)) == ([(0.0, 30.0, "unmarked")], {})


def test_an_episode_ends_at_each_goal_and_begins_when_it_is_left():
    goals = {"goals_m": ((5.0, 0.0), (0.0, 0.0)), "goal_radius_m": 0.52}
    spans, cuts = spans_of(*drive((5, 0), (0, 0), (2, 0)), **goals)
    assert cuts == {"goal": 2}
    assert [outcome for _, _, outcome in spans] == ["arrived", "arrived", "unmarked"]
    np.testing.assert_allclose(
        [(start, end) for start, end, _ in spans], [(1.1, 9.0), (11.1, 19.0), (21.1, 24.0)],
        atol=0.11,
    )  # fmt: skip


AREA = ((4.5, -1.0), (5.5, -1.0), (5.5, 1.0), (4.5, 1.0))


def test_each_lap_to_a_goal_area_is_an_episode_and_the_way_back_is_none():
    spans, cuts = spans_of(*drive((5, 0), (0, 0), (5, 0), (1, 0)), goal_area_m=AREA)
    assert cuts == {"goal": 2}
    assert [outcome for _, _, outcome in spans] == ["arrived", "return", "arrived", "return"]
    np.testing.assert_allclose(
        [(start, end) for start, end, _ in spans],
        [(0.0, 9.0), (11.0, 20.0), (20.0, 29.0), (31.0, 38.0)],
        atol=0.21,
    )


def test_a_stop_on_the_way_back_ends_it():
    spans, _ = spans_of(*drive((5, 0), (0, 0), 15.0, (0, 3)), goal_area_m=AREA)
    assert [outcome for _, _, outcome in spans] == ["arrived", "return", "unmarked"]


def test_a_drive_that_never_comes_to_the_goal_area_is_cut_as_without_one():
    away = drive((0, 5), (0.2, 0))
    assert spans_of(*away, goal_area_m=AREA) == spans_of(*away)


def test_an_episode_ends_where_the_button_is_pressed():
    time_s, position_m = drive((5, 0), (5, 5))
    pressed_s = np.array([-1.0, 4.0, 12.0, 99.0])
    spans, cuts = unmarked_spans(time_s, position_m, 0.5, DriveMapping(), pressed_s)
    assert [(each.start_s, each.end_s) for each in spans] == [
        (0.0, pytest.approx(4.0)),
        (pytest.approx(4.0), pytest.approx(12.0)),
        (pytest.approx(12.0), pytest.approx(20.0)),
    ]
    assert [each.outcome for each in spans] == ["arrived", "arrived", "unmarked"]
    assert cuts == {"button": 2}


def test_a_gap_between_poses_ends_an_episode():
    time_s, position_m = drive((5, 0))
    kept = (time_s < 4.0) | (time_s > 5.0)
    spans, cuts = spans_of(time_s[kept], position_m[kept])
    assert [outcome for _, _, outcome in spans] == ["unmarked", "unmarked"]
    assert cuts == {"gap": 1}


legs = st.one_of(
    st.tuples(st.integers(-5, 5), st.integers(-5, 5)), st.floats(0.5, 20.0, allow_nan=False)
)


@given(st.lists(legs, max_size=8), st.booleans())
def test_episodes_are_in_order_and_do_not_overlap(path, at_goal):
    time_s, position_m = drive(*path)
    mapping = DriveMapping(goals_m=((2.0, 2.0),) if at_goal else ())
    spans, _ = unmarked_spans(time_s, position_m, 0.5, mapping)
    edges = [edge for each in spans for edge in (each.start_s, each.end_s)]
    assert edges == sorted(edges)
    assert all(each.end_s > each.start_s for each in spans)
    assert [each.number for each in spans] == list(range(len(spans)))
