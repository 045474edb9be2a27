"""Rows that contradict each other get a sentence; sane variants and tables of episodes are read."""

import numpy as np
import pandas as pd
import pytest

from serd_app.drives.mapped.mapping import TableMapping
from serd_app.drives.table_drives import drives_of_table, is_table
from serd_bag.errors import FileError
from serd_files.trajectories.columns import TableColumns
from serd_files.yaml_config import yaml_model
from support.trajectory_tables import drives, read

WALKS = pd.DataFrame(
    [(agent, step / 10, 0.12 * step, 0.7 * agent) for agent in (1, 2) for step in range(50)],
    columns=["id", "t", "x", "y"],
)


def sentences(frame, tmp_path):
    """What the table assumes and warns of, besides units."""
    found = read(tmp_path, frame)
    return found.tracks, [each for each in found.assumed if "are assumed" not in each]


def test_rows_out_of_order_are_sorted_and_named(tmp_path):
    swapped = WALKS.copy()
    swapped.iloc[[10, 11]] = WALKS.iloc[[11, 10]].to_numpy()
    tracks, found = sentences(swapped, tmp_path)
    assert found == ["row 12, of agent 1, goes back in time; rows are sorted by time"]
    assert (np.diff(tracks[0].time_s) > 0).all()
    by_time = WALKS.sort_values("t", kind="stable")
    assert sentences(by_time, tmp_path)[1] == []


def test_an_id_that_jumps_is_another_agent_from_there(tmp_path):
    jumped = WALKS.copy()
    jumped.loc[70:99, "x"] += 8.0
    tracks, found = sentences(jumped, tmp_path)
    assert found == ["row 71: agent 2 jumps 8.1 m in 0.1 s; it counts as another one from there"]
    assert [(each.agent, len(each.time_s)) for each in tracks] == [
        ("1", 50), ("2", 20), ("2 part 2", 30),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("rows", "place"),
    [
        ([30], (5.0, 9.0)),
        ([20, 70], (-999.0, -999.0)),
        (range(60, 75), (0.0, -50.0)),
        ([99], (9, 99)),
    ],
)
def test_rows_away_from_where_their_agent_is_are_left_out(tmp_path, rows, place):
    strays = WALKS.copy()
    strays.loc[list(rows), ["x", "y"]] = place
    tracks, found = sentences(strays, tmp_path)
    others = f", as do {len(rows) - 1} other rows" if len(rows) > 1 else ""
    assert found == [
        f"row {rows[0] + 1} lies away from where its agent is before and after{others}; left out"
    ]
    assert [each.agent for each in tracks] == ["1", "2"]
    assert sum(len(each.time_s) for each in tracks) == 100 - len(rows)
    assert np.abs(np.concatenate([each.position_m for each in tracks])).max() < 6.0


@pytest.mark.parametrize(
    ("x_m", "y_m", "speeds"),
    [
        (13.4 + WALKS.x / 68_000, 52.5 + WALKS.y / 111_000, r"1\.8e-05 m/s or slower"),  # degrees
        (100 * WALKS.x, 100 * WALKS.y, "half of them move at 120 m/s or faster"),
    ],
)
def test_units_that_cannot_be_are_refused(tmp_path, x_m, y_m, speeds):
    with pytest.raises(FileError, match=f"{speeds}; state unit: and"):
        sentences(WALKS.assign(x=x_m, y=y_m), tmp_path)


def test_columns_of_lists_get_a_sentence(tmp_path):
    alone = WALKS[WALKS.id == 1].assign(people="[[1.0, 2.0], [3.0, 4.0]]")
    assert sentences(alone, tmp_path)[1] == [
        "column people holds lists, which are not read; give people rows or columns of their own"
    ]


def test_a_person_away_for_a_while_does_not_jump(tmp_path):
    tracks, found = sentences(WALKS.drop(range(10, 40)), tmp_path)
    assert (len(tracks), found) == (2, [])


def test_rows_that_are_there_twice_count_once(tmp_path):
    tracks, found = sentences(pd.concat([WALKS, WALKS]).sort_values(["id", "t"]), tmp_path)
    assert (len(tracks[0].time_s), found) == (50, [])


def test_an_agent_in_two_places_at_once_is_named(tmp_path):
    again = pd.concat([WALKS, WALKS.iloc[[5]] + [0, 0, 0, 2.0]])
    tracks, found = sentences(again, tmp_path)
    assert found[-1] == (
        "agent 1 is in two places at time 0.5, in row 6 and row 101; the first one counts"
    )
    assert tracks[0].position_m[5] == pytest.approx([0.6, 0.7])
    both = pd.concat([WALKS, WALKS.add([0, 0, 0, 2.0])])
    with pytest.raises(FileError, match=r"in row 1 and row 101, as do 99 other rows; give each"):
        sentences(both, tmp_path)


def test_agents_that_hardly_move_get_a_sentence(tmp_path):
    near = WALKS.assign(x=WALKS.x / 100, y=WALKS.y / 100)
    found = sentences(near.rename(columns={"x": "x_m", "y": "y_m"}), tmp_path)[1]
    assert found == [
        "agents move at 0.012 m/s only: 'unit:' and 'fps:' in a --mapping file state other units"
    ]


@pytest.mark.parametrize(
    "names",
    [
        ("robot_x", "robot_y", "person1_x", "person1_y", "person2_x", "person2_y"),
        ("x", "y", "ped_1_x", "ped_1_y", "ped_2_x", "ped_2_y"),
        ("robot_pos_x", "robot_pos_y", "x_p1", "y_p1", "x_p2", "y_p2"),
        ("robot.position.x", "robot.position.y", "person_1.position.x", "person_1.position.y",
         "person_2.position.x", "person_2.position.y"),
        ("robot_px", "robot_py", "ped_0_px", "ped_0_py", "ped_1_px", "ped_1_py"),
        ("rx", "ry", "h1x", "h1y", "h2x", "h2y"),
        ("x", "y", "x1", "y1", "x2", "y2"),
        ("robot_x_cm", "robot_y_cm", "human1_x_cm", "human1_y_cm", "human2_x_cm", "human2_y_cm"),
    ],
)  # fmt: skip
def test_a_robot_and_people_in_columns_of_their_own_are_read(tmp_path, names):
    times = np.arange(50) / 10
    places = np.stack([0.05 * np.arange(50), 0 * times, 5 - 0.1 * np.arange(50), 1 + 0 * times,
                       4 - 0.1 * np.arange(50), 2 + 0 * times], axis=1)  # fmt: skip
    places[:, 4:][20:] = np.nan
    wide = pd.DataFrame(places * (100 if "cm" in names[0] else 1), columns=list(names))
    tracks = read(tmp_path, wide.assign(time=times)).tracks
    assert sorted(len(each.time_s) for each in tracks) == [20, 50, 50]
    (short,) = (each for each in tracks if len(each.time_s) == 20)
    assert short.position_m[0] == pytest.approx([4.0, 2.0])
    found = drives(tmp_path, wide.assign(time=times))
    assert found.drives[0].position_m[-1] == pytest.approx([0.05 * 49, 0.0])
    assert (len(found.drives), len(found.crowd.people)) == (1, 2)


def test_a_column_of_types_names_the_robot(tmp_path):
    typed = WALKS.assign(type=np.where(WALKS.id == 1, "Robot", "pedestrian"))
    found = drives(tmp_path, typed)
    assert len(found.drives) == 1
    assert found.assumed[-1] == "1 demonstrates among 1 people ('experts:')"
    assert len(drives(tmp_path, typed, "experts: ['1', '2']").drives) == 2


@pytest.mark.parametrize(
    ("robot", "person"),
    [("robot_a", "anna"), ("mobile_robot", "7"), ("Robot03", "non-robot"), ("AGV-2", "agvena")],
)
def test_agents_named_as_robots_demonstrate_among_the_others(tmp_path, robot, person):
    found = drives(tmp_path, WALKS.assign(id=np.where(WALKS.id == 1, robot, person)))
    assert [len(found.drives), len(found.crowd.people)] == [1, 1]
    assert found.assumed[-1] == f"{robot} demonstrates among 1 people ('experts:')"


def test_a_robot_that_is_lost_for_a_while_stays_one_beside_people(tmp_path):
    jumped = WALKS.assign(id=np.where(WALKS.id == 1, "robot", "anna"))
    jumped.loc[20:49, "x"] += 8.0
    found = drives(tmp_path, jumped)
    assert [len(found.drives), len(found.crowd.people)] == [2, 1]


def test_where_all_demonstrate_that_is_stated(tmp_path):
    stated = "all 2 agents demonstrate; 'experts:' in a --mapping file names others"
    assert drives(tmp_path, WALKS).assumed[-1] == stated
    robots = drives(tmp_path, WALKS.assign(id="robot_" + WALKS.id.astype(str)))
    assert (len(robots.drives), robots.crowd.people) == (2, ())


@pytest.mark.parametrize(
    ("flags", "mapping"),
    [
        ({"is_robot": (1, 0)}, ""),
        ({"label": ("compliant", "compliant"), "type": ("robot", "human")}, ""),
        ({"type": ("tug", "human")}, "experts: [tug]"),
        ({"id": ("spot_1", "p2")}, "experts: ['spot*']"),
    ],
)
def test_a_flag_a_kind_or_a_pattern_names_the_robot(tmp_path, flags, mapping):
    columns = {name: np.where(WALKS.id == 1, *values) for name, values in flags.items()}
    found = drives(tmp_path, WALKS.assign(**columns), mapping)
    assert [len(found.drives), len(found.crowd.people)] == [1, 1]
    assert found.drives[0].position_m[0] == pytest.approx([0.0, 0.7])


def test_people_of_another_file_are_those_that_the_robot_drives_among(tmp_path):
    WALKS[WALKS.id == 2].to_csv(tmp_path / "people_07.csv", index=False)
    WALKS[WALKS.id == 1].drop(columns="id").to_csv(tmp_path / "run_07.csv", index=False)
    mapping = yaml_model("people: people_*.csv", TableMapping, name="mapping")
    found = drives_of_table(tmp_path / "run_07.csv", mapping)
    assert [len(found.drives), len(found.crowd.people)] == [1, 1]
    (person,) = found.crowd.people
    assert person.position_m[person.time_s == 2.0] == pytest.approx(np.array([[2.4, 1.4]]))
    late = WALKS[WALKS.id == 2].assign(t=WALKS.t + 1e6)
    late.to_csv(tmp_path / "people_07.csv", index=False)
    with pytest.raises(FileError, match=r"people_07\.csv must have the clock of .*run_07"):
        drives_of_table(tmp_path / "run_07.csv", mapping)
    (tmp_path / "run_07.csv").rename(tmp_path / "run.csv")
    with pytest.raises(FileError, match=r"run\.csv must have a number in its name, which \*"):
        drives_of_table(tmp_path / "run.csv", mapping)


def test_a_folder_of_tables_is_no_recording(tmp_path):
    WALKS.to_csv(tmp_path / "walks.csv", index=False)
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
    for drive, person in zip(driven.drives, driven.crowd.people, strict=True):
        assert person.time_s[10] == drive.pose_time_s[10]
        assert person.position_m[10] == pytest.approx([6.8, 2.0])


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
