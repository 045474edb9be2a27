"""Tables of a robot and people in columns: who is the robot is certain, or an error that names the
mapping to write."""

import re

import numpy as np
import pytest

from storage.errors import FileError
from storage.trajectories.columns import TableColumns
from storage.trajectories.read import read_trajectories

TIME_S = 0.1 * np.arange(60)
ROBOT_M = np.stack([0.5 + 0.6 * TIME_S, 0.1 * np.sin(TIME_S)], axis=1)
PERSON_M = np.stack([9.5 - 1.2 * TIME_S, 0.6 + 0.0 * TIME_S], axis=1)
OTHER_M = np.stack([1.0 + 0.8 * TIME_S, 0.9 - 0.1 * TIME_S], axis=1)


def table(tmp_path, names, *columns):
    rows = np.column_stack([TIME_S, *columns])
    text = "\n".join(",".join(f"{number:.6f}" for number in row) for row in rows)
    path = tmp_path / "table.csv"
    path.write_text(f"t,{names}\n{text}\n")
    return path


def tracks_of(path, **wanted):
    read = read_trajectories(path, TableColumns(**wanted))
    return {each.name: each.position_m for each in read.tracks}, " ".join(read.assumed)


@pytest.mark.parametrize(
    ("names", "columns", "people"),
    [
        ("x,y,column,robot_x,robot_y", (PERSON_M, np.ones(60), ROBOT_M), {"person": PERSON_M}),
        ("robot_x,robot_y,x,y", (ROBOT_M, PERSON_M), {"person": PERSON_M}),
        ("x [m],y [m],Robot X [m],Robot Y [m]", (PERSON_M, ROBOT_M), {"person": PERSON_M}),
        ("pos_x,pos_y,robot_pos_x,robot_pos_y", (PERSON_M, ROBOT_M), {"person": PERSON_M}),
        ("x,y,ego_x,ego_y", (PERSON_M, ROBOT_M), {"person": PERSON_M}),
        (
            "robot_x,robot_y,robot_yaw_rad,x1,y1,x2,y2",
            (ROBOT_M, np.zeros(60), PERSON_M, OTHER_M),
            {"person 1": PERSON_M, "person 2": OTHER_M},
        ),
        ("x1,y1,x_robot,y_robot", (PERSON_M, ROBOT_M), {"person 1": PERSON_M}),
        ("x,y,x1,y1", (ROBOT_M, PERSON_M), {"person 1": PERSON_M}),
        ("ped_x,ped_y,robot_x,robot_y", (PERSON_M, ROBOT_M), {"ped": PERSON_M}),
    ],
)
def test_the_robot_is_the_column_that_is_named_so_and_nobody_is_lost(
    tmp_path, names, columns, people
):
    found, _ = tracks_of(table(tmp_path, names, *columns))
    assert found.keys() == {"robot", *people}
    for name, wanted_m in {"robot": ROBOT_M, **people}.items():
        np.testing.assert_allclose(found[name], wanted_m, atol=1e-5)


def test_people_with_ids_in_rows_beside_a_robot_are_told_apart(tmp_path):
    who = np.repeat([[4.0, 7.0]], 30, axis=0).ravel()
    place_m = np.where(who[:, None] == 4.0, PERSON_M, OTHER_M)
    found, _ = tracks_of(table(tmp_path, "id,x,y,robot_x,robot_y", who, place_m, ROBOT_M))
    assert len(found) == 3
    np.testing.assert_allclose(found["robot"], ROBOT_M, atol=1e-5)


@pytest.mark.parametrize(
    "names", ["x,y,pos_x,pos_y", "x,y,x_est,y_est", "local_x,local_y,global_x,global_y"]
)
def test_two_candidates_for_a_place_are_an_error_whose_mapping_reads_the_table(tmp_path, names):
    path = table(tmp_path, names, PERSON_M, ROBOT_M)
    with pytest.raises(FileError, match="must have one pair of columns of places, got") as caught:
        read_trajectories(path)
    mapping = dict(re.findall(r"'([xy]): \"([^\"]+)\"'", str(caught.value)))
    (found,) = tracks_of(path, **mapping)[0].values()
    np.testing.assert_allclose(found, ROBOT_M, atol=1e-5)


@pytest.mark.parametrize(
    ("names", "unused"),
    [
        ("x,y,goal_x,goal_y", "columns goal_x, goal_y of places are not used"),
        ("x,y,vel_x,vel_y", ""),
        ("robot_x,robot_y,orientation_x,orientation_y", ""),
    ],
)
def test_a_column_of_places_that_is_not_used_is_named(tmp_path, names, unused):
    _, assumed = tracks_of(table(tmp_path, names, ROBOT_M, PERSON_M))
    assert ("of places" in assumed) == bool(unused)
    assert unused in assumed


def test_a_mapping_names_the_person_where_that_is_wanted(tmp_path):
    path = table(tmp_path, "x,y,robot_x,robot_y", PERSON_M, ROBOT_M)
    (found,) = tracks_of(path, x="x", y="y")[0].values()
    np.testing.assert_allclose(found, PERSON_M, atol=1e-5)
