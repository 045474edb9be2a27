"""Tables of trajectories in the layouts in which other programs write them."""

import re

import numpy as np
import pytest

from serd_bag.errors import FileError
from serd_files.trajectories.columns import TableColumns
from serd_files.trajectories.read import read_trajectories
from serd_files.yaml_config import yaml_model
from support.trajectory_tables import mappings_in

#: Two agents: 1 walks east at 1.25 m/s from (0, 1), 2 north at 1 m/s from (3, 0).
N_STEPS = 12


def rows(step_s=0.4):
    """(time, agent, x, y) in the order of time."""
    for step in range(N_STEPS):
        time_s = step * step_s
        yield time_s, 1, 1.25 * time_s, 1.0
        yield time_s, 2, 3.0, 1.0 * time_s


def eth():
    lines = ((round(time_s * 25) + 780, agent, x, y) for time_s, agent, x, y in rows())
    return "\n".join("\t".join(map(str, line)) for line in lines)


def petrack(header):
    by_agent = sorted(rows(0.04), key=lambda row: (row[1], row[0]))
    lines = (f"{a} {round(t * 25) + 94} {100 * x:.4f} {100 * y:.4f} 176" for t, a, x, y in by_agent)
    return header + "\n".join(lines)


def named(header, separator, scale=1.0, time_scale=1.0):
    lines = ((a, t * time_scale, x * scale, y * scale) for t, a, x, y in rows())
    return "\n".join([header, *(separator.join(map(str, line)) for line in lines)])


def stamped(header, *of_time):
    return f"{header}\n" + "\n".join(
        ",".join(map(str, (*(each(t) for each in of_time), a, x, y))) for t, a, x, y in rows()
    )


LAYOUTS = {
    "ETH/UCY as SGAN has it": eth(),
    "PeTrack": petrack("# framerate: 25 fps\n# id frame x/cm y/cm z/cm\n"),
    "PeTrack without names": petrack("# framerate: 25.00\n"),
    "names with units": named("track_id,time_s,x_m,y_m", ","),
    "other units": named("person;t [ms];x [cm];y [cm]", ";", 100.0, 1000.0),
    "Unix time in ns": stamped("timestamp,agent,px,py", lambda t: round(t * 1e9) + 17 * 10**17),
    "rostopic echo -p": stamped(
        "%time,id,field.pose.pose.position.x,field.pose.pose.position.y", lambda t: round(t * 1e9)
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


def read(tmp_path, text, **wanted):
    """Trajectories of a file of the text, or of its bytes."""
    path = tmp_path / "table.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_trajectories(path, TableColumns(**wanted) if wanted else None)


TUM = "\n".join(f"{1305031102.1 + 0.1 * n:.4f} {0.1 * n} 2.0 0.3 0 0 0.6 0.8" for n in range(30))
TUM_NAMES = "# ground truth trajectory\n# timestamp tx ty tz qx qy qz qw\n"
PETRACK = "# PeTrack project: walk.pet\n# framerate: 25 fps\n# id frame x/cm y/cm z/cm\n"
FRAMES = "frame_nr,X,Y\n" + "\n".join(f"{n},{n},0" for n in range(0, 33, 16))


def walked(*last):
    """Rows of one person at 1.25 m/s along x, with further cells."""
    return PETRACK + "".join(f"1 {f} {5 * f} {' '.join(map(str, last))}\n" for f in range(60))


@pytest.mark.parametrize(
    ("text", "wanted", "times_s", "last_m"),
    [
        (TUM_NAMES + TUM, {}, (30, 2.9), (2.9, 2.0)),
        (TUM, {}, (30, 2.9), (2.9, 2.0)),
        # The comment names the columns of tables with fewer or more of them.
        (walked(80), {}, (60, 2.36), (2.95, 0.8)),
        (walked(80, 170, 1), {}, (60, 2.36), (2.95, 0.8)),
        (walked(80, 170).replace("\n", "\r\n").encode("utf-8-sig"), {}, (60, 2.36), (2.95, 0.8)),
        ("t;x;y\n0;1,5;2\n0,5;2,25;-1,5", {}, (2, 0.5), (2.25, -1.5)),
        ("t\tx\ty\n0\t1,5\t2\n0,5\t2,25\t-1,5", {}, (2, 0.5), (2.25, -1.5)),
        # A rate makes the named time one of frames, but changes none of a stated unit.
        ("t [s],x,y\n0,1,1\n1,2,1\n", {"fps": 16.0, "unit": "m"}, (2, 1.0), (2, 1)),
        (FRAMES, {"time": "frame_nr", "fps": 16.0, "unit": "m"}, (3, 2.0), (32, 0)),
        ("t,x,y\n2024-01-01T00:00:00,1,1\n2024-01-01T00:00:02,2,1\n", {}, (2, 2.0), (2, 1)),
        # The unit of times does not depend on a step shorter than a nanosecond.
        ("t,x,y\n0,1,1\n3e-308,2,1\n1,3,1\n", {}, (3, 1.0), (3, 1)),
    ],
)
def test_one_agent_is_read_from_every_layout(tmp_path, text, wanted, times_s, last_m):
    (track,) = read(tmp_path, text, **wanted).tracks
    assert (len(track.time_s), np.ptp(track.time_s)) == (times_s[0], pytest.approx(times_s[1]))
    np.testing.assert_allclose(track.position_m[-1], last_m)


@pytest.mark.parametrize(
    ("text", "places_m", "last_sentence"),
    [
        (
            "id,t,x,y\n1,0.0,1,1\n1,0.1,nan,1\n1,0.2,,1\n1,0.3,2,1\n1,0.3,9,9\n1,0.4,3",
            [[1.0, 1.0], [2.0, 1.0]],
            "row 2 lacks a number of time, x or y, as do 2 other rows; left out",
        ),
        *(
            (f"t,x,y\n0,1,1\n1,{number},1\n2,3,1\n", [[1.0, 1.0], [3.0, 1.0]], "row 2 lacks")
            for number in ("9" * 400, "-1" + "0" * 5000)
        ),
    ],
)
def test_rows_without_numbers_are_left_out_and_counted(tmp_path, text, places_m, last_sentence):
    found = read(tmp_path, text)
    assert found.tracks[0].position_m.tolist() == places_m
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
        (named("id,frame,x,y", ",", time_scale=25), "has frames in the column frame and does not"),
        (petrack(""), "has frames in the column frame and does not state how many there are per"),
        (stamped("when,who,east,north", float), "time and x and y are not among when, who, east,"),
        (named("id,rosbag_time,x,y", ","), "time is not among id, rosbag_time, x, y; name the col"),
        (named("who,t,x,y", ","), "is in two places at time 0, in row 1 and row 2, as do 1"),
        (
            stamped("0.0,1,0,1", float),
            "time and x and y are not among 1, 2, 3, 4; name the columns",
        ),
        (  # the height that does not change is no place
            "\n".join(f"{t},{a},{x},0,{y},0.5" for t, a, x, y in rows()),
            "time and x and y are not among 1, 2, 3, 4, 5, 6; name the columns",
        ),
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
        ("t,lat,Longitude\n0,1,2\n1,3,4\n", {}, "lat and Longitude are degrees, convert them"),
        ("t,x,y\n0,1,1\n1,1,1\n", {}, "agents must move, but no place changes; name the columns"),
        ("t,east,north,lat_velocity\n0,1,2,3\n1,3,4,5\n", {}, "as {x: east, y: north}"),
        ("t,name,door\n0,a,c\n1,b,d\n", {}, "are not among t, name, door; export the table with"),
        ("t,lat,lon\n0,100,200\n1,120,220\n", {}, "as {x: lat, y: lon}"),
        ("id,t,x,y\n1,0,1,1\n2,0,1,1\n", {}, "must hold agents with two places at least"),
        ("a\0b", {}, "must be a table of text, it is none"),
        ("t,x,y\n0,1,1\n2,3,1,9\n", {}, "must be a table, but .* Expected 3 fields in line 2"),
        ("t,x,y\n0,1,1", {"x": "east"}, "x must be one of the columns t, x, y, got 'east'; cor"),
    ],
)
def test_what_is_no_table_gets_a_sentence(tmp_path, text, wanted, sentence):
    with pytest.raises(FileError, match=sentence):
        read(tmp_path, text, **wanted)


def two_agents(ids, shift_s=0.0):
    """Rows of two people who walk 3 m apart, the second shift_s later in each frame."""
    rng = np.random.default_rng(0)
    rows = sorted(
        (0.1 * n + shift_s * who, ids[who], 0.13 * n, 3.0 * who + rng.normal() / 99)
        for n in range(60)
        for who in (0, 1)
    )
    return "\n".join(",".join(map(str, row)) for row in rows)


@pytest.mark.parametrize(
    ("shift_s", "sentence"),
    [
        (0.0, r"in two places at time 0, .* 59 other rows; "),
        (0.03, r"in 100 % of the steps .* comes back; "),
    ],
)
def test_several_agents_without_ids_are_rejected(tmp_path, shift_s, sentence):
    with pytest.raises(FileError, match=sentence + "add a column of ids"):
        read(tmp_path, "t,quality,x,y\n" + two_agents((1, 1), shift_s))
    with pytest.raises(FileError, match=sentence + r"name the column .* file: \{agent: who\}$"):
        read(tmp_path, "t,who,x,y\n" + two_agents((7, 9), shift_s))
    assert len(read(tmp_path, "t,who,x,y\n" + two_agents((7, 9), shift_s), agent="who").tracks) == 2
    unnamed = re.sub(r"^([^,]*),(\d+),(.*)$", r"\1,\3,\2", two_agents((7, 9), shift_s), flags=re.M)
    found = read(tmp_path, f"t,x,y\n{unnamed}", agent="4")
    assert [track.agent for track in found.tracks] == ["7", "9"]


@pytest.mark.parametrize("kind", ["still", "repeated", "laps", "outliers", "rounded"])
def test_one_agent_without_ids_is_one(tmp_path, kind):
    rng = np.random.default_rng(0)
    time_s = np.arange(400) / 10.0
    place = np.column_stack([np.cos(time_s), np.sin(time_s)]) + rng.normal(size=(400, 2)) / 100
    if kind == "still":
        place = np.round(rng.normal(size=(400, 2)) / 100, 2)
    if kind == "repeated":
        time_s, place = np.repeat(time_s, 2), np.repeat(place, 2, axis=0)
    if kind == "outliers":
        place[::10] += 5.0
    if kind == "rounded":
        time_s, place = np.floor(time_s), np.column_stack([0.5 * time_s, np.zeros(400)])
    path = tmp_path / "table.csv"
    np.savetxt(path, np.column_stack([time_s, place]), "%.3f", ",", header="t,x,y", comments="")
    assert len(read_trajectories(path).tracks) == 1
