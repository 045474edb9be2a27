"""Growing tables: every row on disk at once."""

import math

import pytest

from serd_bag.errors import FileError
from serd_files.table import Column, RowTable

COLUMNS = (
    Column("name", str),
    Column("seed", int),
    Column("people", int, nullable=True),
    Column("time_s", float),
    Column("gap_m", float),
)

ROWS = [
    {"name": "a, b", "seed": 1, "people": None, "time_s": 0.1 + 0.2, "gap_m": math.inf},
    {"name": 'say "c"', "seed": 2, "people": 3, "time_s": 1e-300, "gap_m": -0.0},
]


def test_rows_read_back_exactly_in_any_order_of_their_columns(tmp_path):
    path = tmp_path / "new" / "rows.CSV"
    for row in ROWS:
        RowTable(path, COLUMNS, ["name", "seed"]).append(dict(reversed(row.items())))
    table = RowTable(path, COLUMNS, ["name", "seed"])
    assert list(table.rows.values()) == ROWS
    assert list(table.rows) == [("a, b", "1"), ('say "c"', "2")]


@pytest.mark.parametrize("kept", [slice(-5), slice(0, 1)])
def test_a_line_cut_short_is_dropped_from_the_file_which_goes_on(tmp_path, kept):
    path = tmp_path / "rows.csv"
    table = RowTable(path, COLUMNS, ["seed"])
    table.append(ROWS[0])
    if kept.stop == 1:  # the header alone
        path.write_text(path.read_text().splitlines()[0] + "\n")
    else:
        table.append(ROWS[1])
        path.write_bytes(path.read_bytes()[kept])
    again = RowTable(path, COLUMNS, ["seed"])
    assert list(again.rows.values()) == ([] if kept.stop == 1 else ROWS[:1])
    assert path.read_bytes().endswith(b"\n")
    again.append(ROWS[1])
    assert list(RowTable(path, COLUMNS, ["seed"]).rows.values())[-1] == ROWS[1]


def test_a_row_with_other_columns_is_refused(tmp_path):
    table = RowTable(tmp_path / "rows.csv", COLUMNS, ["seed"])
    assert not list(tmp_path.iterdir())
    table.append(ROWS[0])
    with pytest.raises(FileError, match="'speed' is in one only; choose another file"):
        table.append({**ROWS[1], "speed": 1.0})


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("rows.csv", b"a,b\n1,2\n", "has no column 'name'; choose another"),
        ("rows.csv", b"one line of mine", "has no column 'name'; choose another file"),
        ("rows.csv", b"seed", "has no column 'name'; choose another file"),
        ("rows.parquet", b"", "must end in .csv, got .*rows.parquet; rename it to rows.csv"),
    ],
)
def test_a_file_that_is_no_such_table_is_refused(tmp_path, name, content, sentence):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(FileError, match=sentence):
        RowTable(path, COLUMNS, ["seed"])
    assert path.read_bytes() == content
