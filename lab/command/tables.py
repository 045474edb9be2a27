"""Result tables in the width of the terminal: columns that do not fit follow in a table below."""

from collections.abc import Callable, Iterable, Sequence

import pandas as pd
from rich.table import Table

from serd_cli.output.terminal import console

#: Of borders and padding, per column.
_AROUND = 3


def print_results(rows: pd.DataFrame, title: str, text: Callable[[object], str]) -> None:
    """Print the rows of a result; text: writes a cell."""
    texts = [list(map(text, row)) for row in rows.itertuples(index=False)]
    for table in tables_that_fit(list(rows.columns), texts, title, console.width):
        console.print(table)


def tables_that_fit(
    columns: Sequence[str], rows: Sequence[Sequence[str]], title: str, width: int
) -> list[Table]:
    """Tables in which no word of a header or cell is broken; titles with the first only.

    Leading columns that are no measurements (no cell has a decimal point) begin each table.
    """
    names = [column.replace("_", " ") for column in columns]
    least = [
        max(_longest_word(name), *(len(row[index]) for row in rows), 1)
        for index, name in enumerate(names)
    ]
    n_keys = _n_keys(rows, len(names))
    groups = _groups(least, n_keys, width - 1)
    return [
        _table(names, rows, least, group, title if number == 0 else "")
        for number, group in enumerate(groups)
    ]


def _longest_word(text: str) -> int:
    return max(map(len, text.split()), default=0)


def _n_keys(rows: Sequence[Sequence[str]], n_columns: int) -> int:
    measured = (index for index in range(n_columns) if any("." in row[index] for row in rows))
    return min(next(measured, 0), n_columns - 1)


def _groups(least: Sequence[int], n_keys: int, width: int) -> list[list[int]]:
    """Indices of the columns of each table, keys first."""
    keys = list(range(n_keys))
    room = width - sum(least[index] + _AROUND for index in keys)
    groups: list[list[int]] = [[]]
    left = room
    for index in range(n_keys, len(least)):
        needed = least[index] + _AROUND
        if needed > left and groups[-1]:
            groups.append([])
            left = room
        groups[-1].append(index)
        left -= needed
    return [[*keys, *group] for group in groups]


def _table(
    names: Sequence[str],
    rows: Iterable[Sequence[str]],
    least: Sequence[int],
    group: Sequence[int],
    title: str,
) -> Table:
    table = Table(title=title or None, title_justify="left")
    for index in group:
        table.add_column(names[index], min_width=least[index], overflow="fold")
    for row in rows:
        table.add_row(*(row[index] for index in group))
    return table
