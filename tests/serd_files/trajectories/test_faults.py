"""Rows that contradict each other get a sentence; sane variants and tables of episodes are read."""

import numpy as np
import pandas as pd
import pytest

from serd_app.drives.recording import is_table
from serd_bag.errors import FileError
from serd_files.trajectories.columns import TableColumns
from support.trajectory_tables import drives, read

WALKS = pd.DataFrame(
    [(agent, step / 10, 0.12 * step, 0.7 * agent) for agent in (1, 2) for step in range(50)],
    columns=["id", "t", "x", "y"],
)


def changed(rows, columns, values, table=WALKS):
    table = table.copy()
    table.loc[list(rows), columns] = values
    return table


BOTH = pd.concat([WALKS[:6], WALKS[5:6].add([0, 0, 0, 2.0]), WALKS[6:]])
SWAPPED = WALKS.iloc[[*range(10), 11, 10, *range(12, 100)]]


@pytest.mark.parametrize(
    ("table", "sentence", "lengths"),
    [
        (SWAPPED, "row 12, of agent 1, goes back in time; rows are sorted by time", [50, 50]),
        (WALKS.sort_values("t", kind="stable"), "", [50, 50]),
        (
            changed(range(70, 100), "x", WALKS.x[70:] + 8.0),
            "row 71: agent 2 jumps 8.1 m in 0.1 s; it counts as another one from there",
            [50, 20, 30],
        ),
        *(
            (
                changed(rows, ["x", "y"], place),
                f"row {rows[0] + 1} lies away from where its agent is before and after{others};"
                " left out",
                lengths,
            )
            for rows, place, others, lengths in (
                ([30], (5.0, 9.0), "", [49, 50]),
                ([20, 70], (-999.0, -999.0), ", as do 1 other rows", [49, 49]),
                (range(60, 75), (0.0, -50.0), ", as do 14 other rows", [50, 35]),
                ([99], (9, 99), "", [50, 49]),
            )
        ),
        (WALKS.drop(range(10, 40)), "", [20, 50]),
        (pd.concat([WALKS, WALKS]).sort_values(["id", "t"]), "", [50, 50]),
        (
            BOTH,
            "agent 1 is in two places at time 0.5, in row 6 and row 7; the first one counts",
            [50, 50],
        ),
    ],
)
def test_what_cannot_be_is_left_out_or_kept_apart_and_named(tmp_path, table, sentence, lengths):
    found = read(tmp_path, table)
    named = [each for each in found.assumed if "are assumed" not in each]
    assert named == [sentence] * bool(sentence)
    assert [len(track.time_s) for track in found.tracks] == lengths
    assert all((np.diff(track.time_s) > 0).all() for track in found.tracks)
    assert np.abs(np.concatenate([each.position_m[:, 1] for each in found.tracks])).max() < 2.0


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        (
            WALKS.assign(x=13.4 + WALKS.x / 68_000, y=52.5 + WALKS.y / 111_000),  # degrees
            r"mean speed is 1\.7e-05 m/s; state unit: and",
        ),
        (
            WALKS.assign(x=100 * WALKS.x, y=100 * WALKS.y),
            r"it is 120 m/s; in cm it is 1\.20 m/s, stated by {unit: cm}",
        ),
        (
            pd.concat([WALKS, WALKS.add([0, 0, 0, 2.0])]),
            r"in row 1 and row 101, as do 99 other rows; give each",
        ),
    ],
)
def test_units_and_ids_that_cannot_be_are_refused(tmp_path, table, sentence):
    with pytest.raises(FileError, match=sentence):
        read(tmp_path, table)


ROBOT_1 = np.where(WALKS.id == 1, "robot", "anna")


@pytest.mark.parametrize(
    ("columns", "mapping", "expected", "assumed"),
    [
        ({}, "", (2, 2), "all 2 agents demonstrate; 'experts:' in a --mapping file names others"),
        ({"id": "robot_" + WALKS.id.astype(str)}, "", (2, 0), ""),
        ({"type": ("Robot", "pedestrian")}, "", (1, 1), "1 demonstrates among 1 people ('exp"),
        ({"type": ("Robot", "pedestrian")}, "experts: ['1', '2']", (2, 2), ""),
        ({"type": ("tug", "human")}, "experts: [tug]", (1, 1), ""),
        ({"label": ("compliant", "ok"), "type": ("robot", "human")}, "", (1, 1), ""),
        ({"agent": ("AGV", "human")}, "", (1, 1), "1 demonstrates among 1 people ('exp"),
        ({"id": ("spot_1", "p2")}, "experts: ['spot*']", (1, 1), ""),
        ({"id": ("robot_a", "anna")}, "", (1, 1), "robot_a demonstrates among 1 people ('exp"),
        ({"id": ("mobile_robot", "7")}, "", (1, 1), "mobile_robot demonstrates among 1 people"),
        ({"id": ("Robot03", "non-robot")}, "", (1, 1), "Robot03 demonstrates among 1 people"),
        ({"id": ("AGV-2", "agvena")}, "", (1, 1), "AGV-2 demonstrates among 1 people"),
        # A robot that is lost for a while stays one.
        ({"id": ROBOT_1, "x": WALKS.x + 8.0 * ((WALKS.index >= 20) & (WALKS.id == 1))}, "",
         (2, 1), ""),
    ],
)  # fmt: skip
def test_kinds_flags_names_and_a_mapping_say_who_demonstrates(
    tmp_path, columns, mapping, expected, assumed
):
    made = {
        name: np.where(WALKS.id == 1, *values) if isinstance(values, tuple) else values
        for name, values in columns.items()
    }
    found = drives(tmp_path, WALKS.assign(**made), mapping)
    assert (len(found.drives), len(found.people)) == expected
    assert found.drives[0].position_m[0] == pytest.approx([0.0, 0.7])
    assert found.assumed[-1].startswith(assumed)


def test_a_folder_of_tables_is_refused(tmp_path):
    WALKS.to_csv(tmp_path / "run.csv")
    with pytest.raises(FileError, match=r"must be a recording, it is a folder of tables; give th"):
        is_table(tmp_path)


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


@pytest.mark.parametrize(("name", "prefix"), [("run", ""), ("Episode", "r"), ("trial_id", "")])
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
    for drive, person in zip(driven.drives, driven.people, strict=True):
        assert person.time_s[10] == drive.pose_time_s[10]
        assert person.position_m[10] == pytest.approx([6.8, 2.0])


ALONE = RUNS[RUNS.id == "robot"].drop(columns="id")


@pytest.mark.parametrize(
    ("table", "agents", "overlap"),
    [
        (ALONE, ["0", "1", "2"], True),
        (ALONE.drop(columns="run"), ["1", "2", "3"], True),
        (RUNS[RUNS.run == 0], ["ped", "robot"], False),
        (RUNS.assign(t=RUNS.t + 100.0 * RUNS.run), None, False),
    ],
)
def test_episodes_are_named_by_a_column_or_begin_where_times_go_back(
    tmp_path, table, agents, overlap
):
    found = read(tmp_path, table)
    assert (OVERLAP in found.assumed) == overlap
    assert [each.agent for each in found.tracks] == agents or (
        not agents and len(found.tracks) == 6
    )
    assert overlap or agents or found.tracks[2].time_s[0] == 200.0


def test_a_mapping_names_the_column_of_episodes(tmp_path):
    odd = RUNS.rename(columns={"run": "drive no"})
    with pytest.raises(FileError, match=r"or of episodes in which ids begin again \(episode:\)"):
        read(tmp_path, odd)
    assert len(read(tmp_path, odd, TableColumns(episode="drive no")).tracks) == 6
