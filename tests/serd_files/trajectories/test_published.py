"""Files of published archives that are no text, and rates that cannot be."""

import json
import sqlite3

import numpy as np
import pytest
from shapely import from_wkt

from serd_app.drives.recording import is_table
from serd_app.journeys.demonstrate import PlaceChoice, demonstrate
from serd_app.places.free_area import stated_area_m
from serd_bag.errors import FileError
from serd_files.trajectories.columns import TableColumns
from serd_files.trajectories.read import read_trajectories
from serd_files.yaml_config import yaml_model
from support.trajectory_tables import mappings_in

FPS = 10.0
#: frame, id, x, y: 1 walks east at 1.2 m/s, 2 north at 1 m/s.
ROWS = [row for n in range(40) for row in ((n, 1, 0.12 * n, 1.0), (n, 2, 3.0, 0.1 * n))]

AREA = "POLYGON ((-1 -1, 6 -1, 6 5, -1 5, -1 -1))"


def hdf5(path):
    h5py = pytest.importorskip("h5py")
    kinds = [("frame", int), ("id", int), ("x", float), ("y", float)]
    with h5py.File(path, "w") as file:
        file.create_dataset("trajectory", data=np.array(ROWS, dtype=kinds)).attrs["fps"] = FPS
        file.attrs["wkt_geometry"] = AREA


def sqlite(path):
    with sqlite3.connect(path) as file:
        file.execute("create table trajectory_data (frame, id, pos_x, pos_y)")
        file.execute("create table metadata (key, value)")
        file.executemany("insert into trajectory_data values (?, ?, ?, ?)", ROWS)
        file.execute("insert into metadata values ('fps', ?), ('version', '2')", (str(FPS),))
        file.execute("create table geometry (hash, wkt)")
        file.execute("insert into geometry values (1, ?)", (AREA,))


def wildtrack(path):
    path.mkdir()
    for frame in range(40):
        people = [
            {"personID": agent, "positionID": 480 * round((y + 9) / 0.025) + round((x + 3) / 0.025)}
            for number, agent, x, y in ROWS
            if number == frame
        ]
        (path / f"{frame:08}.json").write_text(json.dumps(people))


@pytest.mark.parametrize("write", [hdf5, sqlite, wildtrack])
def test_people_of_a_published_archive_are_read_in_metres_and_seconds(tmp_path, write):
    pytest.importorskip("pedpy", reason="PedPy needs Python 3.11")
    path = tmp_path / "recorded"
    write(path)
    assert is_table(path)
    east, north = read_trajectories(path).tracks
    np.testing.assert_allclose(np.diff(east.time_s), 1 / FPS)
    expected = np.array([row[2:] for row in ROWS if row[1] == 1])
    np.testing.assert_allclose(east.position_m, expected, atol=0.0126)
    np.testing.assert_allclose(north.position_m[-1], (3.0, 3.9), atol=0.0126)
    place = demonstrate([path], tmp_path / "decisions.csv", PlaceChoice(cell_size_m=1.0)).place
    assert place.has_walls != path.is_dir()  # a folder of JSON states no area
    if place.has_walls:
        area_m = stated_area_m([path])
        assert area_m is not None
        assert area_m.equals(from_wkt(AREA))
        assert place.grid.n_states == 7 * 6


@pytest.mark.parametrize(
    "content", [b"\x89HDF\r\n\x1a\n" + bytes(90), b"SQLite format 3\0" + bytes(90)]
)
def test_a_file_of_an_archive_that_is_damaged_is_an_error_of_one_line(tmp_path, content):
    pytest.importorskip("pedpy", reason="PedPy needs Python 3.11")
    path = tmp_path / "recorded"
    path.write_bytes(content)
    with pytest.raises(FileError, match="export the table as CSV") as raised:
        read_trajectories(path)
    assert "\n" not in str(raised.value)


def test_a_rate_at_which_people_would_run_is_refused_with_one_at_which_they_walk(tmp_path):
    path = tmp_path / "people.txt"
    rows = [f"{a} {n} {125 * n / 16:.2f} {100 * a} 170" for a in range(5) for n in range(80)]
    path.write_text("\n".join(["# framerate: 25", "# id frame x/cm y/cm z/cm", *rows]))
    with pytest.raises(
        FileError, match=r"it is 1\.95 m/s; the rate of 25 frames .* suspect"
    ) as raised:
        read_trajectories(path)
    right, all_is_right = mappings_in(raised.value)
    assert right == "{fps: 16.0}"
    for mapping, speed_mps in ((right, 1.25), (all_is_right, 1.95)):
        track, *_ = read_trajectories(
            path, yaml_model(mapping, TableColumns, name="mapping")
        ).tracks
        speeds = np.diff(track.position_m[:, 0]) / np.diff(track.time_s)
        np.testing.assert_allclose(speeds, speed_mps, rtol=0.01)
