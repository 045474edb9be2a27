"""Whose the columns of places are: certain, or an error with a mapping that is right."""

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


def wide(names, scale=1.0):
    """A table with columns of the robot and of people, named `x y` of each."""
    pairs = zip(names.split(), np.hstack([ROBOT, *PEOPLE]).T, strict=False)
    return pd.DataFrame({"timestamp": TIME_NS, **{name: scale * each for name, each in pairs}})


def rows_of_people(people):
    """A row per person and time, in which the place of the robot is repeated."""
    frames = [
        pd.DataFrame({"timestamp": TIME_NS, "x": places[:, 0], "y": places[:, 1], "column": number,
                      "robot_x": ROBOT[:, 0], "robot_y": ROBOT[:, 1], "robot_yaw_rad": 0.1})
        for number, places in enumerate(people, start=1)
    ]  # fmt: skip
    return pd.concat(frames).sort_values(["timestamp", "column"], kind="stable")


def assert_robot_among_people(found, n_people):
    """One drive, along the path of the robot, among people who are where they were."""
    (drive,) = found.drives
    np.testing.assert_allclose(drive.position_m, ROBOT, atol=1e-9)
    assert len(found.people) == n_people
    for track, places in zip(found.people, PEOPLE, strict=False):
        np.testing.assert_allclose(track.position_m, places, atol=1e-9)


@pytest.mark.parametrize("n_people", [1, 3])
def test_x_and_y_beside_those_of_the_robot_are_of_people_by_column(tmp_path, n_people):
    """The first layout of NavWareSet."""
    found = drives(tmp_path, rows_of_people(PEOPLE[:n_people]))
    assert_robot_among_people(found, n_people)
    people = [track.agent for track in found.people]
    assert people == [f"person {number + 1}" for number in range(n_people)]
    assert any(f"robot demonstrates among {n_people} people" in each for each in found.assumed)


@pytest.mark.parametrize(
    "names",
    [
        "robot_x robot_y x y",
        "Robot_X Robot_Y X Y",
        "agv.position.x agv.position.y x y",
        "robot_pose_x robot_pose_y px_0 py_0 px_1 py_1",
        "x_robot y_robot x_human1 y_human1 x_human2 y_human2",
        "x y ped_x ped_y",
        "pos_x pos_y x1 y1 x2 y2",
        "robot.position.x robot.position.y person_1.position.x person_1.position.y",
    ],
)
def test_the_robot_is_the_one_that_the_columns_name(tmp_path, names):
    found = drives(tmp_path, wide(names))
    assert_robot_among_people(found, len(names.split()) // 2 - 1)


@pytest.mark.parametrize(
    ("names", "scales"),
    [
        ("robot_x_cm robot_y_cm x_m y_m", (100.0, 1.0)),
        ("robot_x [m] robot_y [m] x [mm] y [mm]", (1.0, 1000.0)),
    ],
)
def test_places_have_the_units_of_their_own_names(tmp_path, names, scales):
    table = wide("a b c d")
    for columns, scale in zip((["a", "b"], ["c", "d"]), scales, strict=True):
        table[columns] *= scale
    table.columns = ["timestamp", *names.replace(" [", "[").split()]
    assert_robot_among_people(drives(tmp_path, table), 1)


@pytest.mark.parametrize(
    ("names", "scale", "sentence", "mappings"),
    [
        ("robot_x_cm robot_y_cm x y", 100.0, "of x, y are not stated; write", ["{unit: cm}"]),
        ("robot_x robot_y ego_x ego_y", 1.0, "has .* and .*; write one of them into a", None),
        ("x y pos_x pos_y", 1.0, "has .* and .*; write one of them into a", None),
        ("spot_x spot_y ped_x ped_y", 1.0, "has .* and .*; write one of them into a", None),
        ("x1 y1 x2 y2", 1.0, "x and y are not among timestamp, ", ["{x: x1, y: y1}"]),
    ],
)
def test_what_is_not_certain_is_an_error_that_shows_right_mappings(
    tmp_path, names, scale, sentence, mappings
):
    x, y, other_x, other_y = names.split()
    table = wide(names, scale)
    with pytest.raises(FileError, match=sentence) as raised:
        drives(tmp_path, table)
    both = [f"{{x: {x}, y: {y}}}", f"{{x: {other_x}, y: {other_y}}}"]
    assert sorted(mappings_in(raised.value)) == sorted(mappings or both)
    for mapping in mappings_in(raised.value):
        drive = drives(tmp_path, table, mapping).drives[0]
        expected = PEOPLE[0] if mapping == both[1] else ROBOT
        np.testing.assert_allclose(drive.position_m, expected, atol=1e-9)


def test_columns_of_the_same_name_are_named_by_their_numbers(tmp_path):
    path = tmp_path / "table.csv"
    table = np.column_stack([STEPS / 10, ROBOT, PEOPLE[0]])
    np.savetxt(path, table, "%.4f", ",", header="t,x,y,x,y", comments="")
    with pytest.raises(FileError, match=r"has x, y and x, y; write one of them") as raised:
        read_trajectories(path)
    _, second = mappings_in(raised.value)
    assert second == "{x: '4', y: '5'}"
    wanted = yaml_model(second, TableMapping, name="mapping")
    (track,) = read_trajectories(path, wanted).tracks
    np.testing.assert_allclose(track.position_m, PEOPLE[0], atol=1e-4)


def test_columns_that_are_not_of_people_are_left_out(tmp_path):
    table = wide("x y").assign(id=1, x1=0.0, y1=0.0)  # beside ids, numbers behind x are none
    assert [track.agent for track in read(tmp_path, table).tracks] == ["1"]
    repeated = wide("robot_x robot_y ped_x ped_y").assign(x=ROBOT[:, 0], y=ROBOT[:, 1])
    assert_robot_among_people(drives(tmp_path, repeated), 1)
    table = wide("robot_x robot_y x y").assign(spot_x=9.0, goal_x=9.0, vel_x=0.6, it_x=1)
    assert_robot_among_people(drives(tmp_path, table), 1)


def test_a_mapping_of_the_columns_of_the_robot_leaves_the_people_among_whom_it_drives(tmp_path):
    table = rows_of_people(PEOPLE).assign(ego_x=1.0, ego_y=RNG.normal(size=3 * N_STEPS))
    found = drives(tmp_path, table, "{x: robot_x, y: robot_y}")
    assert_robot_among_people(found, 3)
    table = wide("spot_x spot_y ped1_x ped1_y ped2_x ped2_y")
    assert_robot_among_people(drives(tmp_path, table, "{x: spot_x, y: spot_y}"), 2)
    table = rows_of_people(PEOPLE).rename(columns={"column": "who", "timestamp": "when"})
    found = drives(tmp_path, table, "{agent: who, time: when, time_unit: ns}")
    assert_robot_among_people(found, 3)
    with pytest.raises(FileError, match=r"agent person is in two places .*\(agent:\)"):
        drives(tmp_path, table.rename(columns={"when": "timestamp"}))


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
    (track,) = read(tmp_path, wide("robot_x robot_y").assign(frame=STEPS)).tracks
    np.testing.assert_allclose(np.diff(track.time_s), 0.1, rtol=1e-5)
