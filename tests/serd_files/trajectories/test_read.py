"""Tables of trajectories in the layouts in which other programs write them."""

import gzip
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from serd_bag.errors import FileError
from serd_files.trajectories.columns import TableColumns
from serd_files.trajectories.read import read_trajectories
from serd_files.yaml_config import yaml_model
from support.trajectory_tables import mappings_in

PEDESTRIANS = Path(__file__).parents[3].parent / "shared" / "data" / "pedestrians"
#: Two agents: 1 walks east at 1.25 m/s from (0, 1), 2 north at 1 m/s from (3, 0).
N_STEPS = 12


def rows(step_s=0.4):
    """(time, agent, x, y) in the order of time."""
    for step in range(N_STEPS):
        time_s = step * step_s
        yield time_s, 1, 1.25 * time_s, 1.0
        yield time_s, 2, 3.0, 1.0 * time_s


def eth(separator="\t"):
    return "\n".join(
        separator.join(map(str, (round(time_s * 25) + 780, agent, x, y)))
        for time_s, agent, x, y in rows()
    )


def petrack(header):
    by_agent = sorted(rows(0.04), key=lambda row: (row[1], row[0]))
    lines = (f"{a} {round(t * 25) + 94} {100 * x:.4f} {100 * y:.4f} 176" for t, a, x, y in by_agent)
    return header + "\n".join(lines)


def named(header, separator, scale=1.0, time_scale=1.0, decimal="."):
    lines = (
        separator.join(
            str(each).replace(".", decimal) for each in (a, t * time_scale, x * scale, y * scale)
        )
        for t, a, x, y in rows()
    )
    return header + "\n" + "\n".join(lines)


def stamped(header, *of_time):
    return f"{header}\n" + "\n".join(
        ",".join(map(str, (*(each(t) for each in of_time), a, x, y))) for t, a, x, y in rows()
    )


LAYOUTS = {
    "ETH/UCY as SGAN has it": eth(),
    "ETH/UCY with spaces": eth(" "),
    "PeTrack": petrack("# framerate: 25 fps\n# id frame x/cm y/cm z/cm\n"),
    "PeTrack without names": petrack("# framerate: 25.00\n"),
    "names with units": named("track_id,time_s,x_m,y_m", ","),
    "other units": named("person;t [ms];x [cm];y [cm]", ";", 100.0, 1000.0),
    "decimal commas": named("ID;Time;X;Y", ";", decimal=","),
    "Unix time in ns": stamped("timestamp,agent,px,py", lambda t: round(t * 1e9) + 17 * 10**17),
    "rostopic echo -p": stamped(
        "%time,id,field.pose.pose.position.x,field.pose.pose.position.y", lambda t: round(t * 1e9)
    ),
    "fields of a ROS message": stamped(
        "header.stamp.sec,header.stamp.nanosec,id,pose.position.x,pose.position.y",
        lambda t: int(t + 1e-6),
        lambda t: round((t - int(t + 1e-6)) * 1e9),
    ),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_two_agents_are_read_from_every_layout(tmp_path, layout):
    path = tmp_path / "table.txt"
    path.write_text(LAYOUTS[layout])
    found = read_trajectories(path)
    assert [track.agent for track in found.tracks] == ["1", "2"]
    first, second = found.tracks
    step_s = 0.04 if "PeTrack" in layout else 0.4
    np.testing.assert_allclose(np.diff(first.time_s), step_s, rtol=1e-6)
    np.testing.assert_allclose(first.position_m[:, 1], 1.0, rtol=1e-6)
    speed = np.diff(first.position_m[:, 0]) / np.diff(first.time_s)
    np.testing.assert_allclose(speed, 1.25, rtol=1e-3)
    np.testing.assert_allclose(second.position_m[:, 0], 3.0, rtol=1e-6)
    assert found.n_bad == 0


def test_a_tum_trajectory_is_one_agent(tmp_path):
    lines = [f"{1305031102.1 + 0.1 * n:.4f} {0.1 * n} 2.0 0.3 0 0 0.6 0.8" for n in range(30)]
    path = tmp_path / "groundtruth.txt"
    path.write_text(
        "# ground truth trajectory\n# timestamp tx ty tz qx qy qz qw\n" + "\n".join(lines)
    )
    (track,) = read_trajectories(path).tracks
    path.write_text("\n".join(lines))
    (unnamed,) = read_trajectories(path).tracks
    for each in (track, unnamed):
        np.testing.assert_allclose(each.position_m[[0, -1]], [[0.0, 2.0], [2.9, 2.0]])
        np.testing.assert_allclose(each.time_s[[0, -1]] - 1305031102.1, [0.0, 2.9], atol=1e-6)


def test_a_kitti_trajectory_lies_in_the_plane_of_the_camera_s_x_and_z(tmp_path):
    path = tmp_path / "00.txt"
    path.write_text("\n".join(f"1 0 0 {0.2 * n} 0 1 0 0.01 0 0 1 {0.8 * n}" for n in range(20)))
    found = read_trajectories(path)
    np.testing.assert_allclose(found.tracks[0].position_m[-1], [3.8, 15.2])
    np.testing.assert_allclose(found.tracks[0].time_s[-1], 1.9)
    assert found.assumed == ()
    given = read_trajectories(path, TableColumns(y="8", fps=5.0))
    np.testing.assert_allclose(given.tracks[0].position_m[-1], [3.8, 0.01])
    np.testing.assert_allclose(given.tracks[0].time_s[-1], 3.8)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (named("id,frame,x,y", ",", time_scale=25), "has frames in the column frame and does not"),
        (petrack(""), "has frames in the column frame and does not state how many there are per"),
        (stamped("when,who,east,north", float), "time and x and y are not among when, who, east,"),
        (named("id,rosbag_time,x,y", ","), "time is not among id, rosbag_time, x, y; name the col"),
        (named("who,t,x,y", ","), "is in two places at time 0, in row 1 and row 2, as do 1"),
        (
            stamped("0.0,1,0,1", float),
            "time and x and y are not among 1, 2, 3, 4; name the columns",
        ),
    ],
)
def test_what_is_not_stated_is_asked_for_with_a_mapping_that_is_read(tmp_path, text, sentence):
    path = tmp_path / "table.txt"
    path.write_text(text)
    with pytest.raises(FileError, match=sentence) as raised:
        read_trajectories(path)
    (advised,) = mappings_in(raised.value)
    wanted = yaml_model(advised, TableColumns, name="mapping")
    first, second = read_trajectories(path, wanted).tracks
    np.testing.assert_allclose(second.position_m[:, 0], 3.0)
    np.testing.assert_allclose(first.position_m[:, 1], 1.0)


def test_rows_without_numbers_and_lines_cut_off_are_left_out_and_counted(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("id,t,x,y\n1,0.0,1,1\n1,0.1,nan,1\n1,0.2,,1\n1,0.3,2,1\n1,0.3,9,9\n1,0.4,3")
    found = read_trajectories(path)
    assert found.tracks[0].position_m.tolist() == [[1.0, 1.0], [2.0, 1.0]]
    assert found.n_bad == 3
    assert found.assumed[-1] == "row 2 lacks a number of time, x or y, as do 2 other rows; left out"


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_are_read_behind_semicolons_and_tabs(tmp_path, separator):
    path = tmp_path / "table.txt"
    rows = [("t", "x", "y"), ("0", "1,5", "2"), ("0,5", "2,25", "-1,5")]
    path.write_text("\n".join(map(separator.join, rows)))
    (track,) = read_trajectories(path).tracks
    assert track.time_s.tolist() == [0.0, 0.5]
    assert track.position_m.tolist() == [[1.5, 2.0], [2.25, -1.5]]


def test_a_rate_in_a_mapping_does_not_change_times_of_a_stated_unit(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("t [s],x,y\n0,1,1\n1,2,1\n")
    (track,) = read_trajectories(path, TableColumns(fps=16.0, unit="m")).tracks
    assert track.time_s[-1] == 1.0


def test_a_rate_in_a_mapping_makes_the_named_time_one_of_frames(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("frame_nr,X,Y\n" + "\n".join(f"{n},{n},0" for n in range(0, 33, 16)))
    given = TableColumns(time="frame_nr", fps=16.0, unit="m")
    assert read_trajectories(path, given).tracks[0].time_s.tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(
    ("name", "unit", "line"),
    [
        ("t", "ms", "places in m are assumed (then agents move at 1 m/s); 'unit:' in a --mapping"),
        ("t [ms]", None, "places in m are assumed (then agents move at 1 m/s); 'unit:' in a"),
    ],
)
def test_units_that_are_not_stated_are_one_line(tmp_path, name, unit, line):
    path = tmp_path / "table.csv"
    path.write_text(f"{name},x,y\n" + "\n".join(f"{500 * n},{0.5 * n},0" for n in range(20)))
    found = read_trajectories(path, TableColumns(time_unit=unit))
    assert len(found.assumed) == 1
    assert found.assumed[0].startswith(line)
    assert found.tracks[0].time_s[-1] == 9.5


def two_agents(ids, shift_s=0.0):
    """Rows of two people who walk 3 m apart, the second shift_s later in each frame."""
    rng = np.random.default_rng(0)
    rows = [
        (
            0.1 * frame + shift_s * person,
            ids[person],
            0.13 * frame,
            3.0 * person + rng.normal() / 99,
        )
        for frame in range(60)
        for person in (0, 1)
    ]
    return "\n".join(",".join(map(str, row)) for row in sorted(rows))


@pytest.mark.parametrize(
    ("shift_s", "sentence"),
    [
        (0.0, r"in two places at time 0, .* 59 other rows; name the column of ids in .*quality\}"),
        (0.03, r"in 100 % of the steps .* comes back; name the column of ids in .*quality\}"),
    ],
)
def test_several_agents_without_ids_are_rejected(tmp_path, shift_s, sentence):
    path = tmp_path / "table.csv"
    path.write_text("t,quality,x,y\n" + two_agents((1, 1), shift_s))
    with pytest.raises(FileError, match=sentence):
        read_trajectories(path)


@pytest.mark.parametrize("kind", ["still", "repeated", "laps", "outliers", "rounded"])
def test_one_agent_without_ids_is_one(tmp_path, kind):
    rng = np.random.default_rng(0)
    time_s = np.arange(400) / 10.0
    place = np.column_stack([np.cos(time_s), np.sin(time_s)]) + rng.normal(size=(400, 2)) / 100
    if kind == "still":
        place = np.round(place * 0.0 + rng.normal(size=(400, 2)) / 100, 2)
    if kind == "repeated":
        time_s, place = np.repeat(time_s, 2), np.repeat(place, 2, axis=0)
    if kind == "outliers":
        place[::10] += 5.0
    if kind == "rounded":
        time_s, place = np.floor(time_s), np.column_stack([0.5 * time_s, np.zeros(400)])
    path = tmp_path / "table.csv"
    np.savetxt(path, np.column_stack([time_s, place]), "%.3f", ",", header="t,x,y", comments="")
    assert len(read_trajectories(path).tracks) == 1


def test_dates_without_other_numbers_than_places_are_read(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("t,x,y\n2024-01-01T00:00:00,1,1\n2024-01-01T00:00:02,2,1\n")
    assert read_trajectories(path).tracks[0].time_s.tolist() == [0.0, 2.0]


def test_rows_with_more_cells_than_the_first_are_counted(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("t,x,y\n0,1,1\n1,2,1\n2,3,1,9\n3,4,1,9\n")
    found = read_trajectories(path)
    assert found.n_bad == 2
    assert found.assumed[-1] == "2 rows with more cells than the first left out"


def test_a_column_that_the_first_line_does_not_name_has_its_number(tmp_path):
    lines = (line.split(",") for line in two_agents((7, 9), 0.0).splitlines())
    path = tmp_path / "table.csv"
    path.write_text("t,x,y\n" + "\n".join(f"{t},{x},{y},{who}" for t, who, x, y in lines))
    found = read_trajectories(path, TableColumns(agent="4"))
    assert [track.agent for track in found.tracks] == ["7", "9"]


@pytest.mark.parametrize("text", ["9" * 400, "-1" + "0" * 5000])
def test_an_integer_beyond_all_numbers_is_no_place(tmp_path, text):
    path = tmp_path / "table.csv"
    path.write_text(f"t,x,y\n0,1,1\n1,{text},1\n2,3,1\n")
    found = read_trajectories(path)
    assert found.n_bad == 1
    assert found.tracks[0].position_m.tolist() == [[1.0, 1.0], [3.0, 1.0]]


PETRACK = "# PeTrack project: walk.pet\n# framerate: 25 fps\n# id frame x/cm y/cm z/cm\n"


def walked(*last):
    """Rows of one person at 1.25 m/s along x, with further cells."""
    return "".join(f"1 {f} {5.0 * f:g} {' '.join(map(str, last))}\n" for f in range(60))


@pytest.mark.parametrize("last", [(80,), (80, 170), (80, 170, 1)])
def test_the_comment_names_the_columns_of_tables_with_fewer_or_more(tmp_path, last):
    path = tmp_path / "walk.txt"
    path.write_text(PETRACK + walked(*last))
    found = read_trajectories(path)
    assert found.assumed == ()
    np.testing.assert_allclose(found.tracks[0].position_m[-1], [2.95, 0.8])
    np.testing.assert_allclose(np.diff(found.tracks[0].time_s), 0.04)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig"])
def test_text_with_a_byte_order_mark_and_windows_line_ends_is_read(tmp_path, encoding):
    path = tmp_path / "walk.txt"
    path.write_bytes((PETRACK + walked(80, 170)).replace("\n", "\r\n").encode(encoding))
    assert len(read_trajectories(path).tracks[0].time_s) == 60


def test_the_unit_does_not_depend_on_a_step_shorter_than_a_nanosecond(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("t,x,y\n0,1,1\n3e-308,2,1\n1,3,1\n")
    (track,) = read_trajectories(path).tracks
    assert track.position_m.tolist() == [[1.0, 1.0], [2.0, 1.0], [3.0, 1.0]]


def test_durations_and_a_repeated_index_of_parquet_are_read(tmp_path):
    path = tmp_path / "table.parquet"
    frame = pd.DataFrame({"t": pd.to_timedelta([0.0, 0.5], "s"), "x": [1.0, 2.0], "y": [0.0, 0.0]})
    frame.set_index("t", drop=False).to_parquet(path)
    assert read_trajectories(path).tracks[0].time_s.tolist() == [0.0, 0.5]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "must hold rows of values, it holds none"),
        ("# only a comment\n", "must hold rows of values, it holds none"),
        ("t,x,y\n", "must hold rows of values below the names of its columns, it holds none"),
        ("t,x,y\n0,1e300,2e300\n1,2e300,2e300\n", "holds none in 2 rows, 0 of which have numb"),
        ("hello\nworld\n", "time and x and y are not among hello; export the table with them"),
        ("t,z\n0,1\n1,2\n", "x and y are not among t, z; export the table with them"),
        ("id,t,x,y\n1,0,1,1\n2,0,1,1\n", "must hold agents with two places at least"),
        ("id,t,x,y\n1,0,1\n2,0,1\n", "must hold agents with two places at least"),
        ("a\0b", "must be a table of text or Parquet"),
    ],
)
def test_what_is_no_table_gets_a_sentence(tmp_path, text, sentence):
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises(FileError, match=sentence):
        read_trajectories(path)


def test_a_column_that_is_not_there_gets_a_sentence(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text(LAYOUTS["names with units"])
    with pytest.raises(
        FileError, match=r"x must be one of the columns track_id, .* got 'east'; cor"
    ):
        read_trajectories(path, TableColumns(x="east"))


@pytest.mark.skipif(not PEDESTRIANS.is_dir(), reason="../shared/data/pedestrians is missing")
@pytest.mark.parametrize(
    ("name", "n_agents", "fps"),
    [("bi_corr_400_b_03", 480, None), ("uo-100-180-180", 121, 16.0), ("uo-180-180-120", 170, 16.0)],
)
def test_real_crowds_walk_at_the_speed_of_people(name, n_agents, fps):
    found = read_trajectories(PEDESTRIANS / f"{name}.txt", TableColumns(fps=fps))
    assert len(found.tracks) == n_agents
    speeds = [
        np.linalg.norm(track.position_m[-1] - track.position_m[0]) / np.ptp(track.time_s)
        for track in found.tracks
    ]
    assert 0.3 < np.median(speeds) < 1.5


def test_a_table_compressed_by_gzip_is_read(tmp_path):
    path = tmp_path / "walk.csv.gz"
    packed = gzip.compress(LAYOUTS["names with units"].encode())
    path.write_bytes(packed)
    assert len(read_trajectories(path).tracks) == 2
    path.write_bytes(packed[:40])
    with pytest.raises(FileError, match="must be a file of gzip, but Compressed file ended before"):
        read_trajectories(path)
