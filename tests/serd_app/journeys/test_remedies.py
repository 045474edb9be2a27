"""Remedies that are printed were tried: they work, or it is said that none does."""

import re

import numpy as np
import pytest
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

from serd_app.demonstrations.decision_table import Place, save_learnable
from serd_app.errors import AppError
from serd_app.journeys.demonstrate import PlaceChoice, demonstrate
from serd_app.learning.learning_files import read_learning_files
from serd_app.learning.recipe import require_enough
from serd_app.learning.settings import LearningSettings
from serd_core.demonstrations.decisions import TIMED_COLUMNS, TimedDecisions
from serd_core.grid.grid import Grid


@pytest.mark.parametrize(("way_m", "works"), [(12.0, True), (3.0, False)])
def test_smaller_cells_are_named_where_they_give_enough_decisions(tmp_path, way_m, works):
    table = tmp_path / "drive.csv"
    times_s = np.arange(0.0, way_m, 0.1)  # at 1 m/s, in cells of about 1 m
    table.write_text("t,x,y\n" + "".join(f"{t:.1f},{t:.2f},0\n" for t in times_s))
    done = demonstrate([table], tmp_path / "decisions.csv", PlaceChoice())
    assert "are too few to learn from (20)" in done.too_few
    assert ("--cell-size-m" in done.too_few) == works
    if works:
        size_m, number = re.search(r"--cell-size-m ([\d.]+) gives (\d+)", done.too_few).groups()
        finer = demonstrate([table], tmp_path / "finer.csv", PlaceChoice(cell_size_m=float(size_m)))
        assert sum(len(each.decisions) for each in finer.found) == int(number) >= 20
        assert not finer.too_few


def ways(*routes):
    """Decisions of drives along states of a row of cells, a second each."""
    rows = [
        (episode, float(n), route[n], 1 + (route[n + 1] < route[n]) * 2, route[n + 1], 1.0, 0)
        for episode, route in enumerate(routes)
        for n in range(len(route) - 1)
    ]
    values = dict(zip(TIMED_COLUMNS, map(np.array, zip(*rows, strict=True)), strict=True))
    return TimedDecisions(**values | {"censored": values["censored"] > 0}, source="ways")


@pytest.mark.parametrize(("n_west", "works"), [(2, True), (0, False)])
def test_another_goal_is_named_where_it_leaves_enough_decisions(tmp_path, n_west, works):
    grid = Grid((0.0, 0.0), 1.0, np.ones((30, 1), dtype=bool))
    routes = [range(25, 30), *[range(20, -1, -1)] * n_west]
    table = tmp_path / "decisions.csv"
    save_learnable(table, Place(grid, 4.0, 1.0), ways(*routes))
    given = ((0.5, 29.5),)  # where the short drive ends
    files = read_learning_files(table, discount=0.9, goals_m=given)
    settings = LearningSettings(minimum_decisions=len(files.decisions) + 1)
    assert files.n_read == sum(len(route) - 1 for route in routes)
    if not works:
        with pytest.raises(AppError, match=r"demonstrate more$"):
            require_enough(files.decisions, settings, files.task)
        return
    (count, place_m), *_ = files.task.other_goals
    again = read_learning_files(table, discount=0.9, goals_m=(place_m,))
    assert count == len(again.decisions)


def test_a_mapping_is_not_advised_where_none_reads_the_bag(tmp_path):
    with Writer(tmp_path / "bag", version=9) as bag:
        store = get_typestore(Stores.ROS2_JAZZY)
        bag.add_connection("/chatter", "std_msgs/msg/String", typestore=store)
    with pytest.raises(AppError, match=r"no mapping reads it: bag .* must hold poses") as raised:
        demonstrate([tmp_path / "bag"], tmp_path / "decisions.csv", PlaceChoice())
    assert "writes a mapping" not in str(raised.value)
