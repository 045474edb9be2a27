"""Decision tables and grid files read back exactly what was written."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from serd_app.demonstrations.decision_table import load_decisions, save_decisions
from serd_bag.errors import FileError
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.grid import Grid
from serd_files.grid_file import load_grid, save_grid


@given(
    st.lists(
        st.tuples(*[st.integers(0, 999)] * 4, st.floats(-1e9, 1e9, allow_nan=False)), max_size=6
    )
)
def test_decisions_survive_a_round_trip(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("table") / "decisions.csv"
    episode, state, action, following, time_s = zip(*rows, strict=True) if rows else [[]] * 5
    decisions = Decisions(episode, time_s, state, action, following, source='a, "b"')
    save_decisions(path, decisions)
    loaded = load_decisions(path)
    for name in ("episode", "time_s", "state", "action", "next_state"):
        assert np.array_equal(getattr(loaded, name), getattr(decisions, name))
    assert loaded.source == (decisions.source if rows else "")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "must have the columns episode, time_s, state, action, next_state, source, got none"),
        ("a,b\n", "must have the columns .*, got a, b"),
        ("HEAD\n1,2,3\n", "line 2 must have 6 columns, got 3"),
        ("HEAD\n1,x,3,4,5,s\n", "line 2, time_s must be a number, got 'x'"),
        ("HEAD\n1,2.0,3.5,4,5,s\n", "line 2, state must be a whole number, got '3.5'"),
        ("HEAD\n1,2.0,-3,4,5,s\n", r"state\[0\] must not be negative, got -3"),
        ("HEAD\n1,nan,3,4,5,s\n", "time_s"),
    ],
)
def test_a_wrong_table_gets_a_sentence(tmp_path, text, sentence):
    path = tmp_path / "decisions.csv"
    path.write_text(text.replace("HEAD", "episode,time_s,state,action,next_state,source"))
    with pytest.raises(FileError, match=sentence):
        load_decisions(path)


@given(
    walkable=arrays(bool, st.tuples(st.integers(1, 6), st.integers(1, 6))).filter(np.any),
    origin_m=st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)),
    cell_size_m=st.floats(0.01, 10.0),
)
def test_grids_survive_a_round_trip(tmp_path_factory, walkable, origin_m, cell_size_m):
    path = tmp_path_factory.mktemp("grid") / "grid.yaml"
    grid = Grid(origin_m, cell_size_m, walkable)
    save_grid(path, grid, scenario="hallway")
    assert load_grid(path).fingerprint() == grid.fingerprint()


def test_an_edited_grid_is_noticed(tmp_path):
    path = tmp_path / "grid.yaml"
    save_grid(path, Grid((0, 0), 1.0, np.array([[1, 1], [0, 1]], dtype=bool)))
    text = path.read_text()
    path.write_text(text.replace("#.", ".."))
    with pytest.raises(FileError, match=r"fingerprint must be .*; the file was edited"):
        load_grid(path)
    path.write_text(text.replace("#.", "#x"))
    with pytest.raises(FileError, match=r"cells\[0\]|cells.* must be 2 of '.'"):
        load_grid(path)
