"""Where a drive without marks is cut into episodes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_app.drives.mapping import DriveMapping, unmarked_spans

STEP_S = 0.1
AREA = {"goal_area_m": ((4.5, -1.0), (5.5, -1.0), (5.5, 1.0), (4.5, 1.0))}
THERE_AND_BACK = (5, 0), (0.2, 0)


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
    """(start, end, outcome) of each episode, and what they were cut at."""
    spans, cuts = unmarked_spans(time_s, position_m, 0.5, DriveMapping(**mapping))
    return [(one.start_s, one.end_s, one.outcome) for one in spans], cuts


@pytest.mark.parametrize(
    ("legs", "mapping", "cuts", "expected"),
    [
        (THERE_AND_BACK, {}, {"turn": 2}, "0-10 arrived, 10-19.6 arrived"),
        (THERE_AND_BACK, {"round_trips": False}, {}, "0-19.6 unmarked"),
        ([(5, 0), (0, 0), (5, 0), (0, 0), (5, 0)], {}, {"turn": 4},
         "0-10 arrived, 10-20 arrived, 20-30 arrived, 30-40 arrived, 40-50 unmarked"),
        ([(4, 0), 15.0, (4, 4), 3.0, (4, 5)], {}, {"stop": 1}, "0-8 arrived, 23-36 unmarked"),
        ([(4, 0), 15.0, (4, 4)], {"stop_s": None}, {}, "0-31 unmarked"),
        ([(4, 0), 15.0, (4, 4)], {"stop_s": 20.0}, {}, "0-31 unmarked"),
        ([30.0], {}, {}, "0-30 unmarked"),
        ([(5, 0), (0, 0), (5, 0), (1, 0)], AREA, {"goal": 2},
         "0-9 arrived, 11-20 return, 20-29 arrived, 31-38 return"),
        ([(5, 0), (0, 0), 15.0, (0, 3)], AREA, {"goal": 1},
         "0-9 arrived, 11-20 return, 35-41 unmarked"),
        ([(0, 5), (0.2, 0)], AREA, {"turn": 2}, "0-10 arrived, 10-20 arrived"),
    ],
)  # fmt: skip
def test_a_drive_is_cut_by_the_rules_of_its_mapping(legs, mapping, cuts, expected):
    spans, found_cuts = spans_of(*drive(*legs), **mapping)
    assert found_cuts == cuts
    texts = [text.split() for text in expected.split(", ")]
    assert [outcome for *_, outcome in spans] == [outcome for _, outcome in texts]
    edges_s = [[float(edge) for edge in edges.split("-")] for edges, _ in texts]
    about_s = 1.0 if "stop" in cuts else 0.21 if "goal" in cuts else 0.06
    np.testing.assert_allclose([span[:2] for span in spans], edges_s, atol=about_s)


def test_a_gap_between_poses_ends_an_episode():
    time_s, position_m = drive((5, 0))
    kept = (time_s < 4.0) | (time_s > 5.0)
    spans, cuts = spans_of(time_s[kept], position_m[kept])
    assert [outcome for *_, outcome in spans] == ["unmarked", "unmarked"]
    np.testing.assert_allclose([span[:2] for span in spans], [[0.0, 3.9], [5.1, time_s[-1]]])
    assert cuts == {"gap": 1}


legs = st.one_of(
    st.tuples(st.integers(-5, 5), st.integers(-5, 5)), st.floats(0.5, 20.0, allow_nan=False)
)


@given(st.lists(legs, max_size=8), st.booleans())
def test_episodes_are_in_order_and_do_not_overlap(path, at_goal):
    mapping = DriveMapping(**AREA) if at_goal else DriveMapping()
    spans, _ = unmarked_spans(*drive(*path), 0.5, mapping)
    edges = [edge for span in spans for edge in (span.start_s, span.end_s)]
    assert edges == sorted(edges)
    assert all(span.end_s > span.start_s for span in spans)
    assert [span.number for span in spans] == list(range(len(spans)))
