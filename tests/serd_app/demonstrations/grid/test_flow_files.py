"""Flow per cell in the table beside demonstrations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from serd_app.demonstrations.grid.flow_field import FlowField, load_flow, save_flow
from serd_bag.errors import FileError
from serd_core.grid.grid import Grid

GRID = Grid((-1.0, 2.0), 0.5, np.array([[True, False, True], [True, True, True]]))


def save(path, grid, flow):
    zeros = np.zeros(grid.n_states, dtype=int)
    velocity = np.zeros((grid.n_states, 2))
    save_flow(path, grid, FlowField(flow, velocity, zeros, zeros))


@settings(deadline=None)
@given(arrays(bool, (3, 4)).filter(lambda cells: cells.any()), st.data())
def test_the_table_gives_back_the_flow(tmp_path_factory, walkable, data):
    grid = Grid((0.1, -7.3), 0.3, walkable)
    directions = st.sampled_from([-1, 1, 2, 3, 4])
    flow = np.array([data.draw(directions) for _ in range(grid.n_states)])
    path = tmp_path_factory.mktemp("flow") / "flow.csv"
    save(path, grid, flow)
    assert load_flow(path, grid).tolist() == flow.tolist()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda _: "", "must have the columns state, x_m, y_m, flow, order, count, vx_mps, vy_mps,"
         " got none"),
        (lambda text: text.replace("north", "nort"), "line 2, flow must be a direction or none,"
         " got 'nort'; did you mean 'north'?"),
        (lambda text: text.replace("-0.75,", "9.0,", 1), "line 2 must be the cell at"),
        (lambda text: text.rsplit("\n", 2)[0], "must have one line for each of the grid's 5"),
    ],
)  # fmt: skip
def test_a_table_that_does_not_fit_gets_a_sentence(tmp_path, change, sentence):
    path = tmp_path / "flow.csv"
    save(path, GRID, np.array([1, 2, 3, 4, -1]))
    path.write_text(change(path.read_text()))
    with pytest.raises(FileError, match="flow") as caught:
        load_flow(path, GRID)
    assert sentence in str(caught.value)
