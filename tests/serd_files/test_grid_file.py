"""Grids and flows in files that people read and edit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from serd_bag.errors import FileError
from serd_core.grid.grid import Grid
from serd_files.grid_file import flow_of_picture, flow_picture, load_grid, save_grid

GRID = Grid((-1.0, 2.0), 0.5, np.array([[True, False, True], [True, True, True]]))


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


@pytest.mark.parametrize(
    ("edited", "sentence"),
    [
        ("..", "fingerprint must be .*; the file was edited"),
        ("#x", r"cells\[0\]|cells.* must be 2 of"),
    ],
)
def test_an_edited_grid_is_noticed(tmp_path, edited, sentence):
    path = tmp_path / "grid.yaml"
    save_grid(path, Grid((0, 0), 1.0, np.array([[1, 1], [0, 1]], dtype=bool)))
    path.write_text(path.read_text().replace("#.", edited))
    with pytest.raises(FileError, match=sentence):
        load_grid(path)


def test_the_picture_has_north_above_and_walls():
    assert flow_picture(GRID, np.array([1, 2, 3, 4, -1])) == ("v<.", "^#>")


@pytest.mark.parametrize(
    "rows", [("v<.",), ("v<.", "^#>", "..."), ("v<", "^#"), ("v<.", "^.>"), ("v<.", "^#x")]
)
def test_what_is_no_picture_of_the_grid_is_none(rows):
    assert flow_of_picture(rows, GRID) is None


@given(arrays(bool, (3, 4)).filter(lambda cells: cells.any()), st.data())
def test_a_picture_gives_back_the_flow(walkable, data):
    grid = Grid((0.1, -7.3), 0.3, walkable)
    directions = st.sampled_from([-1, 1, 2, 3, 4])
    flow = np.array([data.draw(directions) for _ in range(grid.n_states)])
    assert flow_of_picture(flow_picture(grid, flow), grid).tolist() == flow.tolist()
