"""Remedies that are printed were tried: they work, or it is said that none does."""

import re

import numpy as np
import pytest
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

from serd_app.demonstrations.decision_table import Place, save_learnable
from serd_app.demonstrations.discretise import demonstrations_of_bag
from serd_app.drives.mapping import BagMapping
from serd_app.errors import AppError
from serd_app.journeys.demonstrate import PlaceChoice, demonstrate
from serd_app.learning.learning_files import read_learning_files
from serd_app.learning.recipe import require_enough
from serd_app.learning.settings import LearningSettings
from serd_app.places.map_scenario import _ends
from serd_bag.errors import BagError
from serd_core.demonstrations.decisions import TIMED_COLUMNS, TimedDecisions
from serd_core.grid.grid import Grid
from support.bag_messages import Messages
from support.foreign_bags import ForeignBag

#: A row of cells along x.
GRID = Grid((-1.0, -0.5), 1.0, np.ones((1, 12), dtype=bool))


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


def test_a_goal_that_some_drives_reach_is_named_where_none_reaches_the_given_one(tmp_path):
    grid = Grid((0.0, 0.0), 1.0, np.ones((30, 1), dtype=bool))
    table = tmp_path / "decisions.csv"
    save_learnable(table, Place(grid, 4.0, 1.0), ways(range(15), range(2, 15)))
    files = read_learning_files(table, discount=0.9, goals_m=((0.5, 29.5),))
    (remark,) = files.remarks()
    x_m, y_m, n_left = re.search(
        r"name --goal ([\d.]+),([\d.]+), .* after (\d+) dec", remark
    ).groups()
    again = read_learning_files(table, discount=0.9, goals_m=((float(x_m), float(y_m)),))
    assert len(again.decisions) == int(n_left)
    assert len(again.reaching) == 2
    assert not [*again.remarks()]


def test_a_flow_of_none_is_taken_where_it_is_advised(tmp_path):
    grid = Grid((0.0, 0.0), 1.0, np.ones((30, 1), dtype=bool))
    table = tmp_path / "decisions.csv"
    save_learnable(table, Place(grid, 4.0, 1.0), ways(range(15)))
    with pytest.raises(AppError, match=r"use --flow none$"):
        read_learning_files(table, discount=0.9, flow="recorded")
    assert read_learning_files(table, discount=0.9, flow="none").flow_from == "none"


def test_hidden_actions_are_read_where_they_are_advised(tmp_path):
    """Poses without a heading, by which no velocity can be turned."""
    bag = ForeignBag(Messages())
    time_s = np.arange(0.0, 20.0, 0.1)
    track = np.column_stack([time_s, 0.4 * time_s, 0 * time_s, 0 * time_s, 0.4 + 0 * time_s])
    bag.add_odometry("/odom", track)
    bag.add_commands("/moves", [(t, 0.4, 0.0) for t in time_s[::3]])
    path, axes = bag.write(tmp_path / "bag"), ("x", "y")
    fields = {
        "pose_topic": "/odom",
        "pose_fields": tuple(f"pose.pose.position.{axis}" for axis in axes),
    }
    mapping = BagMapping(action_topic="/moves", action_from="velocity", **fields)
    with pytest.raises(BagError, match=r"x and y alone; .*action_from: hidden"):
        demonstrations_of_bag(path, GRID, 4.0, 1.0, mapping)
    hidden = BagMapping(action_from="hidden", **fields)
    decisions, _ = demonstrations_of_bag(path, GRID, 4.0, 1.0, hidden)
    assert len(decisions) >= 7


def test_a_start_from_which_moves_lead_to_the_goal_is_named_where_the_given_one_is_none():
    two_rooms = np.ones((6, 9), dtype=bool)
    two_rooms[:, 4] = False
    grid = Grid((0.0, 0.0), 1.0, two_rooms)
    goal, start = (int(grid.states_at(np.array([each]))[0]) for each in ([8.5, 5.5], [0.5, 0.5]))
    rooms = np.ones(grid.n_states, dtype=bool)
    with pytest.raises(AppError, match=r"take --start ") as raised:
        _ends(grid, rooms, goal, start)
    x_m, y_m = re.search(r"--start ([\d.]+),([\d.]+)", str(raised.value)).groups()
    named = int(grid.states_at(np.array([[float(x_m), float(y_m)]]))[0])
    assert _ends(grid, rooms, goal, named)[:2] == (goal, named)
    alone = np.zeros(grid.n_states, dtype=bool)
    with pytest.raises(AppError, match=r"mend the map"):
        _ends(grid, alone | (np.arange(grid.n_states) == goal), goal, start)
