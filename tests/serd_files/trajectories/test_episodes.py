"""Ids and times that begin again in each episode."""

import numpy as np
import pandas as pd
import pytest

from serd_bag.errors import FileError
from serd_files.trajectories.columns import TableColumns
from support.trajectory_tables import drives, read

#: A robot goes east and a person west, in each of three runs; times begin again.
RUNS = pd.DataFrame(
    [
        (run, step / 10, name, x_m, y_m)
        for run in range(3)
        for step in range(40 + run)
        for name, x_m, y_m in (("robot", 0.1 * step, 0.3 * run), ("ped", 8 - 0.12 * step, 2.0))
    ],
    columns=["run", "t", "id", "x", "y"],
)
OVERLAP = "times of 3 episodes overlap, so each has a clock of its own"


@pytest.mark.parametrize("name", ["run", "Episode", "trial_id", "scene"])
@pytest.mark.parametrize("prefix", ["", "r"])
def test_an_id_is_another_agent_in_each_episode_at_its_own_time(tmp_path, name, prefix):
    named = RUNS.assign(run=prefix + RUNS.run.astype(str)).rename(columns={"run": name})
    found = read(tmp_path, named)
    assert found.assumed[0] == OVERLAP
    assert found.tracks[0].time_s[0] == 0.0
    assert [each.agent for each in found.tracks] == [
        f"{who} of {name} {prefix}{run}" for who in ("ped", "robot") for run in range(3)
    ]
    driven = drives(tmp_path, named)
    assert [len(each.pose_time_s) for each in driven.drives] == [40, 41, 42]
    assert [each.position_m[0, 1] for each in driven.drives] == pytest.approx([0.0, 0.3, 0.6])
    for row, drive in enumerate(driven.drives):
        (others,) = driven.crowd.others_at(row, drive.pose_time_s[[10]])
        assert others == pytest.approx(np.array([[6.8, 2.0]]))


def test_episodes_on_one_clock_keep_their_times(tmp_path):
    found = read(tmp_path, RUNS.assign(t=RUNS.t + 100.0 * RUNS.run))
    assert OVERLAP not in found.assumed
    assert found.tracks[2].time_s[0] == 200.0


def test_without_ids_the_episode_is_the_agent(tmp_path):
    alone = RUNS[RUNS.id == "robot"].drop(columns="id")
    found = read(tmp_path, alone)
    assert [each.agent for each in found.tracks] == ["0", "1", "2"]
    assert (np.diff([each.time_s[0] for each in found.tracks]) > 100.0).all()


def test_without_ids_and_episodes_these_begin_where_times_go_back(tmp_path):
    alone = RUNS[RUNS.id == "robot"].drop(columns=["id", "run"])
    found = read(tmp_path, alone)
    assert found.assumed[0] == OVERLAP
    assert [each.agent for each in found.tracks] == ["1", "2", "3"]
    assert [len(each.time_s) for each in found.tracks] == [40, 41, 42]


@pytest.mark.parametrize("has_runs", [True, False])
def test_columns_of_each_agent_have_episodes_too(tmp_path, has_runs):
    wide = RUNS.pivot(index=["run", "t"], columns="id", values=["x", "y"]).reset_index()
    wide.columns = ["run", "t", "ped1_x", "robot_x", "ped1_y", "robot_y"]
    found = drives(tmp_path, wide if has_runs else wide.drop(columns="run"))
    assert found.assumed[0] == OVERLAP
    assert [len(each.pose_time_s) for each in found.drives] == [40, 41, 42]
    assert len(found.crowd.people) == 3


def test_an_id_of_one_episode_alone_keeps_its_name(tmp_path):
    found = read(tmp_path, RUNS[RUNS.run == 0])
    assert [each.agent for each in found.tracks] == ["ped", "robot"]


def test_a_mapping_names_the_column_of_episodes(tmp_path):
    odd = RUNS.rename(columns={"run": "drive no"})
    with pytest.raises(FileError, match=r"or of episodes in which ids begin again \(episode:\)"):
        read(tmp_path, odd)
    assert len(read(tmp_path, odd, TableColumns(episode="drive no")).tracks) == 6
