"""Tables of trajectories in the layouts in which other programs write them."""

import gzip

import numpy as np
import pandas as pd
import pytest

from serd_bag.errors import FileError
from serd_files.trajectories.columns import TableColumns
from serd_files.trajectories.read import read_trajectories
from serd_files.yaml_config import yaml_model
from support.trajectory_tables import mappings_in

#: Two agents: 1 walks east at 1.25 m/s from (0, 1), 2 north at 1 m/s from (3, 0).
TIME_S = np.repeat(0.4 * np.arange(12), 2)
WALK = pd.DataFrame({"a": [1, 2] * 12, "t": TIME_S, "x": 3.0, "y": TIME_S})
WALK.loc[WALK.a == 1, ["x", "y"]] = np.column_stack([1.25 * TIME_S[::2], np.ones(12)])


def lines(header, scales=(1, 1, 1), time=None, separator=",", **options):
    """A table below a header; scales: of time, x and y; time: the columns in place of the agent's
    and of times."""
    table = WALK * [1, scales[0], scales[1], scales[2]]
    if time is not None:
        table = pd.DataFrame(time).assign(a=WALK.a, x=table.x, y=table.y)
    return header + table.to_csv(index=False, header=False, sep=separator, **options)


FRAME = (TIME_S * 25).round().astype(int)
PETRACK_ROWS = sorted(lines("", (1, 100, 100), {"f": FRAME + 94}, " ").splitlines())
PETRACK = "".join(f"{a} {f} {x} {y} 176\n" for f, a, x, y in map(str.split, PETRACK_ROWS))
TIME_NS = (TIME_S * 1e9).round().astype(int)
STAMPS = {"s": TIME_NS // 10**9, "ns": TIME_NS % 10**9}
OF_MESSAGE = "id,pose.position.x,pose.position.y\n"
LAYOUTS = {
    "ETH/UCY as SGAN has it": lines("", time={"f": FRAME + 780}, separator="\t"),
    "ETH/UCY with spaces": lines("", time={"f": FRAME + 780}, separator=" "),
    "PeTrack": f"# framerate: 25 fps\n# id frame x/cm y/cm z/cm\n{PETRACK}",
    "PeTrack without names": f"# framerate: 25.00\n{PETRACK}",
    "names with units": lines("track_id,time_s,x_m,y_m\n"),
    "other units": lines("person;t [ms];x [cm];y [cm]\n", (1000, 100, 100), separator=";"),
    "decimal commas": lines("ID;Time;X;Y\n", separator=";", decimal=","),
    "Unix time in ns": lines("timestamp,agent,px,py\n", time={"t": TIME_NS + 17 * 10**17}),
    "rostopic echo -p": lines("%time,id,field.pose.position.x,field.y\n", time={"t": TIME_NS}),
    "fields of a ROS message": lines(f"stamp.sec,stamp.nanosec,{OF_MESSAGE}", time=STAMPS),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_two_agents_are_read_from_every_layout(tmp_path, layout):
    found = read(tmp_path, LAYOUTS[layout])
    assert [track.agent for track in found.tracks] == ["1", "2"]
    first, second = found.tracks
    np.testing.assert_allclose(np.diff(first.time_s), 0.4, rtol=1e-6)
    np.testing.assert_allclose(first.position_m[:, 1], 1.0, rtol=1e-6)
    speed = np.diff(first.position_m[:, 0]) / np.diff(first.time_s)
    np.testing.assert_allclose(speed, 1.25, rtol=1e-3)
    np.testing.assert_allclose(second.position_m[:, 0], 3.0, rtol=1e-6)
    assert found.n_bad == 0


def read(tmp_path, text, **wanted):
    """Trajectories of a file of the text, or of its bytes."""
    path = tmp_path / "table.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_trajectories(path, TableColumns(**wanted) if wanted else None)


TUM = "\n".join(f"{1305031102.1 + 0.1 * n:.4f} {0.1 * n} 2.0 0.3 0 0 0.6 0.8" for n in range(30))
TUM_NAMES = "# ground truth trajectory\n# timestamp tx ty tz qx qy qz qw\n"
NAMED = "# PeTrack project: walk.pet\n# framerate: 25 fps\n# id frame x/cm y/cm z/cm\n"
FRAMES = "frame_nr,X,Y\n" + "\n".join(f"{n},{n},0" for n in range(0, 33, 16))
GZIP = gzip.compress(b"t,x,y\n0,1,1\n1,2,1", mtime=0)


def walked(*last):
    """Rows of one person at 1.25 m/s along x, with further cells."""
    return NAMED + "".join(f"1 {f} {5 * f} {' '.join(map(str, last))}\n" for f in range(60))


@pytest.mark.parametrize(
    ("text", "wanted", "times_s", "last_m"),
    [
        (TUM_NAMES + TUM, {}, (30, 2.9), (2.9, 2.0)),
        (TUM, {}, (30, 2.9), (2.9, 2.0)),
        # The comment names the columns of tables with fewer or more of them.
        (walked(80), {}, (60, 2.36), (2.95, 0.8)),
        (walked(80, 170, 1), {}, (60, 2.36), (2.95, 0.8)),
        (walked(80, 170).replace("\n", "\r\n").encode("utf-16"), {}, (60, 2.36), (2.95, 0.8)),
        (walked(80, 170).replace("\n", "\r\n").encode("utf-8-sig"), {}, (60, 2.36), (2.95, 0.8)),
        ("t;x;y\n0;1,5;2\n0,5;2,25;-1,5", {}, (2, 0.5), (2.25, -1.5)),
        ("t\tx\ty\n0\t1,5\t2\n0,5\t2,25\t-1,5", {}, (2, 0.5), (2.25, -1.5)),
        # A rate makes the named time one of frames, but changes none of a stated unit.
        ("t [s],x,y\n0,1,1\n1,2,1\n", {"fps": 16.0, "unit": "m"}, (2, 1.0), (2, 1)),
        (FRAMES, {"time": "frame_nr", "fps": 16.0, "unit": "m"}, (3, 2.0), (32, 0)),
        ("t,x,y\n2024-01-01T00:00:00,1,1\n2024-01-01T00:00:02,2,1\n", {}, (2, 2.0), (2, 1)),
        # The unit of times does not depend on a step shorter than a nanosecond.
        ("t,x,y\n0,1,1\n3e-308,2,1\n1,3,1\n", {}, (3, 1.0), (3, 1)),
        (GZIP, {}, (2, 1.0), (2, 1)),
    ],
)
def test_one_agent_is_read_from_every_layout(tmp_path, text, wanted, times_s, last_m):
    (track,) = read(tmp_path, text, **wanted).tracks
    assert (len(track.time_s), np.ptp(track.time_s)) == (times_s[0], pytest.approx(times_s[1]))
    np.testing.assert_allclose(track.position_m[-1], last_m)


def test_durations_and_a_repeated_index_of_parquet_are_read(tmp_path):
    path = tmp_path / "table.parquet"
    frame = pd.DataFrame({"t": pd.to_timedelta([0.0, 0.5], "s"), "x": [1.0, 2.0], "y": [0.0, 0.0]})
    frame.set_index("t", drop=False).to_parquet(path)
    assert read_trajectories(path).tracks[0].time_s.tolist() == [0.0, 0.5]


@pytest.mark.parametrize(
    ("text", "places_m", "n_bad", "last_sentence"),
    [
        (
            "id,t,x,y\n1,0.0,1,1\n1,0.1,nan,1\n1,0.2,,1\n1,0.3,2,1\n1,0.3,9,9\n1,0.4,3",
            [[1.0, 1.0], [2.0, 1.0]],
            3,
            "row 2 lacks a number of time, x or y, as do 2 other rows; left out",
        ),
        (
            "t,x,y\n0,1,1\n1,2,1\n2,3,1,9\n3,4,1,9\n",
            [[1.0, 1.0], [2.0, 1.0]],
            2,
            "2 rows with more cells than the first left out",
        ),
        *(
            (f"t,x,y\n0,1,1\n1,{number},1\n2,3,1\n", [[1.0, 1.0], [3.0, 1.0]], 1, "row 2 lacks")
            for number in ("9" * 400, "-1" + "0" * 5000)
        ),
    ],
)
def test_rows_without_numbers_or_with_too_many_cells_are_left_out_and_counted(
    tmp_path, text, places_m, n_bad, last_sentence
):
    found = read(tmp_path, text)
    assert (found.tracks[0].position_m.tolist(), found.n_bad) == (places_m, n_bad)
    assert found.assumed[-1].startswith(last_sentence)


@pytest.mark.parametrize(("name", "unit"), [("t", "ms"), ("t [ms]", None)])
def test_units_that_are_not_stated_are_one_line(tmp_path, name, unit):
    text = f"{name},x,y\n" + "\n".join(f"{500 * n},{0.5 * n},0" for n in range(20))
    found = read(tmp_path, text, time_unit=unit)
    assert len(found.assumed) == 1
    assert found.assumed[0].startswith("places in m are assumed (then agents move at 1 m/s); 'uni")
    assert found.tracks[0].time_s[-1] == 9.5


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (lines("id,frame,x,y\n", (25, 1, 1)), "has frames in the column frame and does not"),
        (PETRACK, "has frames in the column frame and does not state how many there are per"),
        (lines("when,who,east,north\n", time={"t": TIME_S}), "time and x and y are not among when"),
        (lines("id,rosbag_time,x,y\n"), "time is not among id, rosbag_time, x, y; name the col"),
        (lines("who,t,x,y\n"), "is in two places at time 0, in row 1 and row 2, as do 1"),
        (lines("", time={"t": TIME_S}), "time and x and y are not among 1, 2, 3, 4; name the col"),
    ],
)
def test_what_is_not_stated_is_asked_for_with_a_mapping_that_is_read(tmp_path, text, sentence):
    with pytest.raises(FileError, match=sentence) as raised:
        read(tmp_path, text)
    (advised,) = mappings_in(raised.value)
    wanted = yaml_model(advised, TableColumns, name="mapping")
    first, second = read_trajectories(tmp_path / "table.csv", wanted).tracks
    np.testing.assert_allclose(second.position_m[:, 0], 3.0)
    np.testing.assert_allclose(first.position_m[:, 1], 1.0)


@pytest.mark.parametrize(
    ("text", "wanted", "sentence"),
    [
        ("", {}, "must hold rows of values, it holds none"),
        ("# only a comment\n", {}, "must hold rows of values, it holds none"),
        ("t,x,y\n", {}, "must hold rows of values below the names of its columns, it holds none"),
        ("t,x,y\n0,1e300,2e300\n1,2e300,2e300\n", {}, "holds none in 2 rows, 0 of which have"),
        ("hello\nworld\n", {}, "time and x and y are not among hello; export the table with them"),
        ("t,z\n0,1\n1,2\n", {}, "x and y are not among t, z; export the table with them"),
        ("id,t,x,y\n1,0,1,1\n2,0,1,1\n", {}, "must hold agents with two places at least"),
        ("a\0b", {}, "must be a table of text or Parquet"),
        ("t,x,y\n0,1,1", {"x": "east"}, "x must be one of the columns t, x, y, got 'east'; cor"),
        (GZIP[:20], {}, "must be a file of gzip, but Compressed file ended before"),
    ],
)
def test_what_is_no_table_gets_a_sentence(tmp_path, text, wanted, sentence):
    with pytest.raises(FileError, match=sentence):
        read(tmp_path, text, **wanted)


def two_agents(ids, shift_s):
    """Rows of two people who walk 3 m apart, the second shift_s later in each frame."""
    rows = sorted(
        (0.1 * n + shift_s * who, 0.13 * n, 3.0 * who, ids[who])
        for n in range(60)
        for who in (0, 1)
    )
    return "\n".join(",".join(map(str, row)) for row in rows)


@pytest.mark.parametrize(
    ("shift_s", "sentence"),
    [
        (0.0, r"in two places at time 0, .* 59 other rows; name the column of ids in .*quality\}"),
        (0.03, r"half of them move at .* m/s or faster; .*, or the column of ids by agent:"),
    ],
)
def test_several_agents_without_ids_are_rejected(tmp_path, shift_s, sentence):
    with pytest.raises(FileError, match=sentence):
        read(tmp_path, "t,x,y,quality\n" + two_agents((1, 1), shift_s))
    found = read(tmp_path, "t,x,y\n" + two_agents((7, 9), shift_s), agent="4")
    assert [track.agent for track in found.tracks] == ["7", "9"]
