"""Which columns hold time and place: certain, or an error with a mapping that is right."""

import numpy as np
import pandas as pd
import pytest

from serd_app.drives.mapping import TableMapping
from serd_bag.errors import FileError
from serd_files.trajectories.read import read_trajectories
from serd_files.yaml_config import yaml_model
from support.trajectory_tables import drives, mappings_in, read

N_STEPS = 50
TIME_NS = 1_700_000_000_000_000_000 + 100_000_000 * np.arange(N_STEPS)
RNG = np.random.default_rng(4)
STEPS = np.arange(N_STEPS)
#: A robot that drives east at 0.6 m/s, two people who meet it, and one who stands.
ROBOT, *PEOPLE = (
    np.column_stack([x_m, np.full(N_STEPS, y_m)]) + RNG.normal(size=(N_STEPS, 2)) / 200
    for x_m, y_m in (
        (0.06 * STEPS, 0.0), (9.0 - 0.12 * STEPS, 0.7), (8.0 - 0.09 * STEPS, -0.8), (0 * STEPS, 4),
    )
)  # fmt: skip


def wide(names):
    """A table with columns of the robot and of people, named `x y` of each."""
    pairs = zip(names.split(), np.hstack([ROBOT, *PEOPLE]).T, strict=False)
    return pd.DataFrame({"timestamp": TIME_NS, **dict(pairs)})


def rows_of_people(people):
    """A row per person and time, in which the place of the robot is repeated."""
    frames = [
        pd.DataFrame({"timestamp": TIME_NS, "x": places[:, 0], "y": places[:, 1], "column": number,
                      "robot_x": ROBOT[:, 0], "robot_y": ROBOT[:, 1], "robot_yaw_rad": 0.1})
        for number, places in enumerate(people, start=1)
    ]  # fmt: skip
    return pd.concat(frames).sort_values(["timestamp", "column"], kind="stable")


@pytest.mark.parametrize("n_people", [1, 3])
@pytest.mark.parametrize("layout", ["rows", "columns"])
def test_the_robot_of_navwareset_drives_among_people_by_row_or_by_column(
    tmp_path, layout, n_people
):
    names = ["robot_x", "robot_y", "x1", "y1", "x2", "y2", "x3", "y3"][: 2 + 2 * n_people]
    table = rows_of_people(PEOPLE[:n_people]) if layout == "rows" else wide(" ".join(names))
    found = drives(tmp_path, table)
    (drive,) = found.drives
    np.testing.assert_allclose(drive.position_m, ROBOT, atol=1e-9)
    assert [track.agent for track in found.people] == [
        f"person {number + 1}" for number in range(n_people)
    ]
    for track, places in zip(found.people, PEOPLE, strict=False):
        np.testing.assert_allclose(track.position_m, places, atol=1e-9)
    assert any(f"robot demonstrates among {n_people} people" in each for each in found.assumed)


def test_x_and_y_have_the_units_of_their_own_names_or_both_none(tmp_path):
    table = wide("x[cm] y[mm]")
    table["x[cm]"], table["y[mm]"] = 100.0 * table["x[cm]"], 1000.0 * table["y[mm]"]
    np.testing.assert_allclose(read(tmp_path, table).tracks[0].position_m, ROBOT, atol=1e-9)
    with pytest.raises(FileError, match=r"must state the units of x and y or of none; .*: cm}"):
        read(tmp_path, wide("x[cm] y"))


#: By what is not certain: names of columns, and what the error shows, the right one first.
NOT_CERTAIN = {
    "x y pos_x pos_y": ["{x: x, y: y}", "{x: pos_x, y: pos_y}"],
    "spot_x spot_y ped_x ped_y": [
        "{robot_columns: [spot_x, spot_y], people_columns: [[ped_x, ped_y]]}"
    ],
    "robot_odom_x robot_odom_y robot_gps_x robot_gps_y": [
        "{robot_columns: [robot_odom_x, robot_odom_y]}",
        "{robot_columns: [robot_gps_x, robot_gps_y]}",
    ],
    "robot_x robot_y x y": ["{robot_columns: [robot_x, robot_y]}", "{robot_columns: [x, y]}"],
    "base_x base_y map_x map_y": [
        "{robot_columns: [base_x, base_y]}",
        "{robot_columns: [map_x, map_y]}",
    ],
}


@pytest.mark.parametrize("names", NOT_CERTAIN)
def test_what_is_not_certain_is_an_error_that_shows_mappings_which_work(tmp_path, names):
    with pytest.raises(FileError, match=r"must have one (pair of columns|column of x)") as raised:
        read(tmp_path, wide(names))
    assert mappings_in(raised.value) == NOT_CERTAIN[names]
    (drive,) = drives(tmp_path, wide(names), NOT_CERTAIN[names][0]).drives
    np.testing.assert_allclose(drive.position_m, ROBOT, atol=1e-9)


@pytest.mark.parametrize(
    ("names", "people"),
    [
        ("robot_x robot_y ped1_x ped1_y ped2_x ped2_y", ["ped_1", "ped_2"]),
        ("x_robot y_robot x_1 y_1", ["person 1"]),
        ("agvPosX agvPosY human_x human_y goal_x goal_y", ["human"]),
        ("robot.pose.x robot.pose.y anna_x anna_y", []),
    ],
)
def test_a_robot_that_is_named_so_is_read_and_coordinates_that_are_not_used_are_named(
    tmp_path, names, people
):
    found = drives(tmp_path, wide(names))
    (drive,) = found.drives
    np.testing.assert_allclose(drive.position_m, ROBOT, atol=1e-9)
    assert [track.agent for track in found.people] == people
    for left in ("goal_x, goal_y", "anna_x, anna_y"):
        said = any(left in each and "not used" in each for each in found.assumed)
        assert said == (left.split(",")[0] in names)


def test_columns_of_the_same_name_are_named_by_their_numbers(tmp_path):
    path = tmp_path / "table.csv"
    table = np.column_stack([STEPS / 10, ROBOT, PEOPLE[0]])
    np.savetxt(path, table, "%.4f", ",", header="t,x,y,x,y", comments="")
    with pytest.raises(FileError, match=r"it has x and x; write one of them") as raised:
        read_trajectories(path)
    assert mappings_in(raised.value)[1] == "{x: '4', y: '5'}"
    wanted = yaml_model("{x: '4', y: '5'}", TableMapping, name="mapping")
    (track,) = read_trajectories(path, wanted).tracks
    np.testing.assert_allclose(track.position_m, PEOPLE[0], atol=1e-4)


def test_of_two_columns_of_times_one_must_be_named_but_a_time_is_preferred_to_frames(tmp_path):
    late = TIME_NS / 1e9 + np.cumsum(RNG.uniform(0.0, 2.0, N_STEPS))
    table = wide("x y").assign(stamp=late)
    with pytest.raises(FileError, match=r"it has timestamp and stamp; write one of") as raised:
        read(tmp_path, table)
    assert mappings_in(raised.value) == ["{time: timestamp}", "{time: stamp}"]
    for mapping, time_s in zip(mappings_in(raised.value), (TIME_NS / 1e9, late), strict=True):
        wanted = yaml_model(mapping, TableMapping, name="mapping")
        (track,) = read(tmp_path, table, wanted).tracks
        np.testing.assert_allclose(np.diff(track.time_s), np.diff(time_s), atol=1e-4)
    (track,) = read(tmp_path, wide("x y").assign(frame=STEPS)).tracks
    np.testing.assert_allclose(np.diff(track.time_s), 0.1, rtol=1e-5)


#: Headers of a robot and people, and what is read without a mapping: the ids of people.
CERTAIN = {
    "Robot_X Robot_Y Ped_1_X Ped_1_Y": ["ped_1"],
    "robot_x_m robot_y_m human_x_m human_y_m": ["human"],
    "robotx roboty ped1x ped1y": ["ped_1"],
    "robotX robotY pedX pedY": ["ped"],
    "X_robot Y_robot X_ped1 Y_ped1": ["ped_1"],
    "robot-x robot-y ped-1-x ped-1-y": ["ped_1"],
    "robot/pose/x robot/pose/y person/x person/y": ["person"],
    "robot.x robot.y people[0].x people[0].y": ["people_0"],
    "robot_px robot_py human0_px human0_py human0_vx human0_vy": ["human_0"],
    "ego_x ego_y agent_0_x agent_0_y": ["agent_0"],
    "robot_x robot_y ped_x_1 ped_y_1 ped_x_2 ped_y_2": ["ped_1", "ped_2"],
    "robot_x robot_y nearestx nearesty": [],
    "robot_x robot_y robot_goal_x robot_goal_y ped_x ped_y": ["ped"],
}
#: Headers that are refused with a mapping, and the people whom its first one reads.
REFUSED = {
    "rx ry p1x p1y": ["p_1"],
    "xr yr xh yh": ["h"],
    "x_r y_r x_h y_h": ["h"],
    "pose_x pose_y human1_pos_x human1_pos_y": ["human_1"],
    "base_link_x base_link_y person1_x person1_y": ["person_1"],
    "turtlebot_x turtlebot_y human_x human_y": ["human"],
    "x y ped1_x ped1_y": ["ped_1"],
    "robot1_x robot1_y robot2_x robot2_y ped_x ped_y": ["ped"],
    "jackalx jackaly odomx odomy": [],
    "robot_east robot_north": [],
}


def require_robot_among(found, names, people):
    """The robot, these people, and a sentence with each pair of coordinates that is neither."""
    drive, *others = found.drives
    np.testing.assert_allclose(drive.position_m, ROBOT, atol=1e-9)
    assert not others
    assert [track.agent for track in found.people] == people
    n_left = len(names.split()) // 2 - 1 - len(people) - names.count("_vx")
    (said,) = [each for each in found.assumed if "not used" in each] or [""]
    assert said.split(" are not used")[0].count(", ") == n_left


@pytest.mark.parametrize("names", CERTAIN)
def test_a_header_that_names_a_robot_is_read_and_each_unused_pair_named(tmp_path, names):
    require_robot_among(drives(tmp_path, wide(names)), names, CERTAIN[names])


@pytest.mark.parametrize("names", REFUSED)
def test_a_header_without_one_robot_is_refused_with_a_mapping_that_works(tmp_path, names):
    with pytest.raises(FileError) as raised:
        read(tmp_path, wide(names))
    first, *_ = mappings_in(raised.value)
    require_robot_among(drives(tmp_path, wide(names), first), names, REFUSED[names])


@pytest.mark.parametrize(
    ("names", "mapping"),
    [
        ("person_id person_x person_y robot_x robot_y", ""),
        ("human_id human_pos_x human_pos_y robot_pos_x robot_pos_y", ""),
        ("id x y robotx roboty", ""),
        ("agent x y ego_x ego_y", ""),
        ("pid px py robot_px robot_py", "{agent: pid}"),
    ],
)
def test_people_by_row_are_read_beside_the_robot_that_each_row_repeats(tmp_path, names, mapping):
    given = ["column", "x", "y", "robot_x", "robot_y"]
    table = rows_of_people(PEOPLE).rename(columns=dict(zip(given, names.split(), strict=True)))
    if mapping:
        with pytest.raises(FileError) as raised:
            read(tmp_path, table)
        assert mappings_in(raised.value)[0] == mapping
    found = drives(tmp_path, table, mapping)
    (drive,) = found.drives
    np.testing.assert_allclose(drive.position_m, ROBOT, atol=1e-9)
    for track, places in zip(found.people, PEOPLE, strict=True):
        np.testing.assert_allclose(track.position_m, places, atol=1e-9)
