"""Which columns hold the places: certain, or an error with a mapping that is right."""

import numpy as np
import pandas as pd
import pytest

from serd_app.drives.mapped.mapping import TableMapping
from serd_bag.errors import FileError
from serd_files.yaml_config import yaml_model
from support.trajectory_tables import drives, mappings_in, read

STEPS = np.arange(50)
TIME_NS = 1_700_000_000_000_000_000 + 100_000_000 * STEPS
RNG = np.random.default_rng(4)
#: A robot that drives east at 0.6 m/s, and two people who meet it.
ROBOT, *PEOPLE = (
    np.column_stack([x_m, np.full(50, y_m)]) + RNG.normal(size=(50, 2)) / 200
    for x_m, y_m in ((0.06 * STEPS, 0.0), (9.0 - 0.12 * STEPS, 0.7), (8.0 - 0.09 * STEPS, -0.8))
)


def wide(names, scale=1.0):
    """A table with columns of the robot and of people, named `x y` of each."""
    pairs = zip(names.split(), np.hstack([ROBOT, *PEOPLE]).T, strict=False)
    return pd.DataFrame({"timestamp": TIME_NS, **{name: scale * each for name, each in pairs}})


def rows_of_people():
    """A row per person and time, in which the place of the robot is repeated."""
    frames = [
        pd.DataFrame({"timestamp": TIME_NS, "x": places[:, 0], "y": places[:, 1], "column": number,
                      "robot_x": ROBOT[:, 0], "robot_y": ROBOT[:, 1], "robot_yaw_rad": 0.1})
        for number, places in enumerate(PEOPLE, start=1)
    ]  # fmt: skip
    return pd.concat(frames).sort_values(["timestamp", "column"], kind="stable")


def assert_robot_among_people(found):
    """One drive, along the path of the robot, among people who are where they were."""
    (drive,) = found.drives
    np.testing.assert_allclose(drive.position_m, ROBOT, atol=1e-9)
    for track, places in zip(found.crowd.people, PEOPLE, strict=True):
        np.testing.assert_allclose(track.position_m, places, atol=1e-9)


@pytest.mark.parametrize("table", [rows_of_people(), wide("robot_x robot_y x1 y1 x2 y2")])
def test_the_robot_and_people_are_read_from_both_layouts_of_navwareset(tmp_path, table):
    found = drives(tmp_path, table)
    assert_robot_among_people(found)
    assert [track.agent for track in found.crowd.people] == ["person 1", "person 2"]
    assert any("robot demonstrates among 2 people" in each for each in found.assumed)
    table.to_csv(tmp_path / "people.csv", index=False)
    found = drives(tmp_path, wide("x y"), "people: people.csv")
    assert_robot_among_people(found)
    assert "people.csv: its robots are left out, as table.csv has them" in found.assumed
    wide("x y").assign(id="robot").to_csv(tmp_path / "people.csv", index=False)
    with pytest.raises(FileError, match="must hold people, it holds robots alone; correct people:"):
        drives(tmp_path, wide("x y"), "people: people.csv")


@pytest.mark.parametrize(
    "names",
    ["X Y", "pos_x pos_y", "poseX poseY", "pose.position.x pose.position.y", "map_px map_py"],
)
def test_x_and_y_may_stand_beside_words_for_a_place(tmp_path, names):
    (track,) = read(tmp_path, wide(names).assign(goal_x=1.0, vel_y=0.2)).tracks
    np.testing.assert_allclose(track.position_m, ROBOT, atol=1e-9)


@pytest.mark.parametrize(
    ("names", "scale", "sentence", "mapping", "expected"),
    [
        ("x_cm y", 100.0, "that of y is not stated; write", "{unit: cm}", ROBOT),
        ("robot_x robot_y x y", 1.0, "has robot_x, robot_y, x, y; give", "{x: x, y: y}", PEOPLE[0]),
        ("x y pos_x pos_y", 1.0, "it has x, y, pos_x, pos_y; give", "{x: x, y: y}", ROBOT),
        ("x y spot_x spot_y", 1.0, "it has x, y, spot_x, spot_y; give", "{x: x, y: y}", ROBOT),
        ("x y x2 y2", 1.0, "it has x, y, x2, y2; give", "{x: x, y: y}", ROBOT),
        ("robot_x robot_y", 1.0, "x and y are not among", "{x: robot_x, y: robot_y}", ROBOT),
        ("x1 y1 x2 y2", 1.0, "x and y are not among timestamp, ", "{x: x1, y: y1}", ROBOT),
        ("rx ry", 1.0, "x and y are not among timestamp, ", "{x: rx, y: ry}", ROBOT),
    ],
)
def test_what_is_not_certain_is_an_error_that_shows_a_right_mapping(
    tmp_path, names, scale, sentence, mapping, expected
):
    table = wide(names, scale)
    with pytest.raises(FileError, match=sentence) as raised:
        read(tmp_path, table)
    assert mappings_in(raised.value) == [mapping]
    found = read(tmp_path, table, yaml_model(mapping, TableMapping, name="mapping"))
    np.testing.assert_allclose(found.tracks[0].position_m, expected, atol=1e-9)
    others = [name for name in names.split() if "x:" in mapping and name not in mapping]
    assert any("not used" in each for each in found.assumed) == bool(others)


def test_columns_of_the_same_name_are_named_by_their_numbers(tmp_path):
    table = wide("a b c d").set_axis(["timestamp", "x", "y", "x", "y"], axis=1)
    with pytest.raises(FileError, match="it has x, y, x, y; give") as raised:
        read(tmp_path, table)
    assert mappings_in(raised.value) == ["{x: '2', y: '3'}"]
    (track,) = read(tmp_path, table, TableMapping(x="4", y="5")).tracks
    np.testing.assert_allclose(track.position_m, PEOPLE[0], atol=1e-9)


def test_of_two_columns_of_times_one_must_be_named_but_a_time_is_preferred_to_frames(tmp_path):
    late = TIME_NS / 1e9 + np.cumsum(RNG.uniform(0.0, 2.0, 50))
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
