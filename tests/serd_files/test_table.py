"""Typed tables: exact round trips, and one message per fault with its place and the fix."""

import math
from dataclasses import asdict, astuple, dataclass, replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_bag.errors import FileError
from serd_files.table import (
    EpisodeResult,
    OptionalFloat,
    RowTable,
    append_row,
    columns_of,
    load_episodes,
    read_rows,
    read_table,
    write_rows,
    write_table,
)
from support.episodes import episode_result


@dataclass(frozen=True)
class Drive:
    """A row of each kind of column."""

    episode: int
    n_people: int | None
    time_s: float
    arrival_s: OptionalFloat
    name: str = ""


COLUMNS = columns_of(Drive)
HEADER = "episode,n_people,time_s,arrival_s,name\n"

drives = st.builds(
    Drive,
    episode=st.integers(-(2**63), 2**63 - 1),
    n_people=st.none() | st.integers(0, 10**6),
    time_s=st.floats(allow_nan=False),
    arrival_s=st.floats(allow_nan=False),
    name=st.text(st.characters(exclude_characters="\r\0", codec="utf-8")),
)


@settings(deadline=None)
@given(st.lists(drives, max_size=4))
def test_rows_read_back_exactly(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("table") / "drives.csv"
    write_table(path, COLUMNS, [astuple(row) for row in rows])
    assert read_rows(path, Drive) == tuple(rows)


def test_appended_rows_are_those_of_a_table_written_at_once(tmp_path):
    rows = [(1, None, 0.1 + 0.2, math.nan, 'a, "b"\nc'), (2, 3, -0.0, 1e-300, "")]
    for row in rows:
        append_row(tmp_path / "new" / "appended.csv", COLUMNS, row)
    write_table(tmp_path / "written.csv", COLUMNS, rows)
    written = (tmp_path / "written.csv").read_bytes()
    assert (tmp_path / "new" / "appended.csv").read_bytes() == written
    assert b"0.30000000000000004" in written


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "must have the columns episode, n_people, time_s, arrival_s, name, got none; it"),
        ("episode,episode\n", "got episode, episode; it has no column 'n_people'; choose"),
        (HEADER[:-1] + ",name\n", "it has others, or in another order; choose another file"),
        (HEADER + "1,2\n", "line 2 must have 5 columns, got 2; correct the line"),
        (HEADER + "1,2,3.0,4.0,a,b\n", "line 2 must have 5 columns, got 6; correct the line"),
        (HEADER + "\n1.5,2,3.0,4.0,a\n", "line 3, episode must be a whole number, got '1.5'; corr"),
        (HEADER + ",2,3.0,4.0,a\n", "line 2, episode must be a whole number, got ''; correct"),
        (HEADER + "1,two,3.0,4.0,a\n", "line 2, n_people must be a whole number, got 'two'"),
        (HEADER + "1,2,nan,4.0,a\n", "line 2, time_s must be a number, got 'nan'; correct"),
        (HEADER + "1,2,,4.0,a\n", "line 2, time_s must be a number, got ''; correct the line"),
        (HEADER + '1,2,3.0,4.0,"a\n', "line 2 must be CSV, but unexpected end of data; correct"),
        (HEADER + "1,2,3.0,4.0," + "a" * 200_000, "line 2 must be CSV, but field larger than"),
        (HEADER + f"{2**63},2,3.0,4.0,a\n", "line 2, episode must be a whole number, got '92233"),
        (HEADER + f"{'9' * 5000},2,3.0,4.0,a\n", "line 2, episode must be a whole number, got '9"),
        (HEADER + '1,2,3.0,4.0,"a\nb"\nx,2,3.0,4.0,c\n', "line 4, episode must be a whole number"),
        (HEADER + "1,2,0.5,7.0,a\n2,2,0.", "line 3 must have 5 columns, got 3"),
        (bytes(range(256)), "must be UTF-8 text, got byte 0x80"),
    ],
)  # fmt: skip
def test_a_fault_is_named_with_its_place_value_and_fix(tmp_path, text, sentence):
    path = tmp_path / "drives.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(FileError, match=sentence) as caught:
        read_table(path, COLUMNS)
    assert str(caught.value).startswith(str(path))
    assert len(str(caught.value)) < len(str(path)) + 200


@pytest.mark.parametrize("text", ["", "epis", HEADER[:-1], HEADER + "1,2,0.5,7.0,a\n2,2,0."])
def test_a_growing_table_may_end_within_its_header_or_a_row(tmp_path, text):
    path, row = tmp_path / "drives.csv", Drive(1, 2, 0.5, 7.0, "a")
    path.write_text(text)
    n_rows = text.count("\n1,2")
    assert read_table(path, COLUMNS, growing=True) == [asdict(row)] * n_rows
    append_row(path, COLUMNS, astuple(row))
    assert list(read_rows(path, Drive)) == [row] * (n_rows + 1)


@pytest.mark.parametrize(
    ("column", "value", "sentence"),
    [
        ("episode", None, "episode must be a whole number, got ''"),
        ("episode", 2**63, "episode must be a whole number, got"),
        ("episode", 1.5, "episode must be a whole number, got '1.5'"),
        ("time_s", math.nan, "time_s must be a number, got 'nan'"),
        ("name", "a\rb", "name must hold no carriage return and no NUL"),
        ("name", "\0", "name must hold no carriage return and no NUL"),
    ],
)
def test_a_row_that_could_not_be_read_is_not_written(tmp_path, column, value, sentence):
    row = list(astuple(replace(Drive(1, None, 0.5, math.nan, "a"), **{column: value})))
    with pytest.raises(FileError, match=sentence):
        write_table(tmp_path / "drives.csv", COLUMNS, [row])
    with pytest.raises(FileError, match=sentence):
        append_row(tmp_path / "growing.csv", COLUMNS, row)
    assert not list(tmp_path.iterdir())


GROWN = [
    {"episode": 1, "n_people": None, "time_s": 0.1 + 0.2, "arrival_s": math.inf, "name": "a, b"},
    {"episode": 2, "n_people": 3, "time_s": 1e-300, "arrival_s": -0.0, "name": 'say "c"'},
]


def test_rows_read_back_exactly_in_any_order_of_their_columns(tmp_path):
    path = tmp_path / "new" / "rows.CSV"
    for row in GROWN:
        RowTable(path, COLUMNS, ["name", "episode"]).append(dict(reversed(row.items())))
    table = RowTable(path, COLUMNS, ["name", "episode"])
    assert list(table.rows.values()) == GROWN
    assert list(table.rows) == [("a, b", "1"), ('say "c"', "2")]


@pytest.mark.parametrize("n_whole", [0, 1])
def test_a_line_cut_short_is_dropped_from_the_file_which_goes_on(tmp_path, n_whole):
    path = tmp_path / "rows.csv"
    for row in GROWN[: n_whole + 1]:
        RowTable(path, COLUMNS, ["episode"]).append(row)
    path.write_bytes(path.read_bytes()[:-5])
    again = RowTable(path, COLUMNS, ["episode"])
    assert list(again.rows.values()) == GROWN[:n_whole]
    assert path.read_bytes().endswith(b"\n")
    again.append(GROWN[1])
    assert list(RowTable(path, COLUMNS, ["episode"]).rows.values())[-1] == GROWN[1]


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("rows.csv", b"a,b\n1,2\n", "has no column 'episode'; choose another"),
        ("rows.csv", b"name", "has no column 'episode'; choose another file"),
        ("rows.parquet", b"", "must end in .csv, got .*rows.parquet; rename it to rows.csv"),
    ],
)
def test_a_file_that_is_no_such_table_is_refused(tmp_path, name, content, sentence):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(FileError, match=sentence):
        RowTable(path, COLUMNS, ["episode"])
    assert path.read_bytes() == content


@pytest.mark.parametrize(
    ("outcome", "time_s"),
    [("arrived", -1.5), ("arrived", math.inf), ("timeout", 0.3), ("arrived", math.nan)],
)
def test_a_time_of_arrival_that_cannot_be_is_named_by_file_and_line(tmp_path, outcome, time_s):
    rows = [episode_result(0, "arrived", 0.3), episode_result(1, outcome, time_s)]
    write_rows(tmp_path / "episodes.csv", EpisodeResult, rows)
    sentence = f"line 3, time_of_arrival_s must be finite .* got {time_s} and {outcome!r}"
    with pytest.raises(FileError, match=f"episodes.csv: {sentence}"):
        load_episodes(tmp_path / "episodes.csv")
