"""Growing tables: every row on disk at once, CSV or Parquet by suffix."""

import math

import pytest

from serd_bag.errors import FileError
from serd_files.row_table import RowTable, new_rows_path
from serd_files.table import Column, read_table, records

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


@pytest.mark.parametrize("name", ["rows.csv", "rows.parquet", "rows.PARQUET"])
def test_rows_read_back_exactly_whatever_the_file(tmp_path, name):
    path = tmp_path / "new" / name
    for row in ROWS:
        with RowTable(path, COLUMNS, ["name", "seed"]) as table:
            table.append(row)
    with RowTable(path, COLUMNS, ["name", "seed"]) as table:
        assert list(table.rows.values()) == ROWS
        assert list(table.rows) == [("a, b", "1"), ('say "c"', "2")]
    assert [each.name for each in path.parent.iterdir()] == [name]


@pytest.mark.parametrize("name", ["rows.csv", "rows.parquet"])
def test_the_order_of_a_row_does_not_matter(tmp_path, name):
    with RowTable(tmp_path / name, COLUMNS, ["name", "seed"]) as table:
        table.append(dict(reversed(ROWS[0].items())))
    with RowTable(tmp_path / name, COLUMNS, ["name", "seed"]) as table:
        assert list(table.rows.values()) == ROWS[:1]


def test_a_row_is_on_disk_before_the_table_is_closed(tmp_path):
    table = RowTable(tmp_path / "rows.parquet", COLUMNS, ["seed"])
    table.append(ROWS[0])
    assert len(new_rows_path(table.path).read_text().splitlines()) == 2
    table.close()
    assert records(read_table(table.path, COLUMNS)) == ROWS[:1]


def test_a_table_of_nothing_leaves_no_file(tmp_path):
    with RowTable(tmp_path / "rows.parquet", COLUMNS, ["seed"]):
        pass
    assert not list(tmp_path.iterdir())


def test_a_line_cut_short_is_dropped_from_the_file(tmp_path):
    path = tmp_path / "rows.csv"
    with RowTable(path, COLUMNS, ["seed"]) as table:
        table.append(ROWS[0])
        table.append(ROWS[1])
    path.write_bytes(path.read_bytes()[:-5])
    with RowTable(path, COLUMNS, ["seed"]) as table:
        assert list(table.rows.values()) == ROWS[:1]
    assert path.read_bytes().endswith(b"\n")


def test_a_row_with_other_columns_is_refused(tmp_path):
    with RowTable(tmp_path / "rows.csv", COLUMNS, ["seed"]) as table:
        table.append(ROWS[0])
        with pytest.raises(FileError, match="'speed' is in one only; choose another file"):
            table.append({**ROWS[1], "speed": 1.0})


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        (
            "rows.csv",
            b"a,b\n1,2\n",
            "has no column 'name'; choose another",
        ),
        ("rows.csv", b"one line of mine", "has no column 'name'; choose another file"),
        ("rows.csv", b"one line of mine\n", "has no column 'name'; choose another file"),
        ("rows.csv", b"seed", "has no column 'name'; choose another file"),
        ("rows.parquet", b"no parquet at all", "must be a Parquet file"),
        ("rows.xlsx", b"", "must end in .csv or .parquet, got .*rows.xlsx; rename it to rows.csv"),
    ],
)
def test_a_file_that_is_no_such_table_is_refused(tmp_path, name, content, sentence):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(FileError, match=sentence):
        RowTable(path, COLUMNS, ["seed"])
    assert path.read_bytes() == content


def test_a_table_that_ends_after_its_header_goes_on(tmp_path):
    path = tmp_path / "rows.csv"
    with RowTable(path, COLUMNS, ["seed"]) as table:
        table.append(ROWS[0])
    path.write_text(path.read_text().splitlines()[0] + "\n")
    with RowTable(path, COLUMNS, ["seed"]) as table:
        assert table.rows == {}
        table.append(ROWS[0])
    with RowTable(path, COLUMNS, ["seed"]) as table:
        assert list(table.rows.values()) == ROWS[:1]
