"""Tables of results in 80 columns."""

import pandas as pd
import pytest
from rich.console import Console

from lab.command.tables import print_results, tables_that_fit
from serd_cli.output.terminal import console, progress_console

RESULTS = ("detour", "avoidance", "hidden-actions", "gridworld")


@pytest.mark.parametrize("name", RESULTS)
def test_no_word_of_a_header_is_broken_in_80_columns(root, name):
    rows = pd.read_csv(root / f"docs/results/{name}.csv").head(3)
    texts = [
        [f"{value:.2f}" if isinstance(value, float) else str(value) for value in row]
        for row in rows.itertuples(index=False)
    ]
    console = Console(width=80, force_terminal=False)
    with console.capture() as capture:
        for table in tables_that_fit(list(rows.columns), texts, "results", console.width):
            console.print(table)
    shown = capture.get()
    words = {word for line in shown.splitlines() for word in line.replace("┃", " ").split()}
    for column in rows.columns:
        assert set(column.split("_")) <= words, column
    assert "…" not in shown
    assert max(map(len, shown.splitlines())) <= 80


def test_keys_begin_each_table_and_what_fits_is_one_table():
    rows = [["MDCE SERD", "4", "-0.583", "0.024"]]
    columns = ["learner", "size", "log_likelihood", "divergence"]
    assert len(tables_that_fit(columns, rows, "t", 80)) == 1
    first, second = tables_that_fit(columns, rows, "t", 36)
    assert [column.header for column in first.columns] == ["learner", "size", "log likelihood"]
    assert [column.header for column in second.columns] == ["learner", "size", "divergence"]


def test_brackets_and_colons_of_names_are_printed_as_they_are(capsys):
    name = "[/x]:warning:[red]"
    print_results(pd.DataFrame({"recording": [name]}), name, str)
    console.print(name)
    progress_console.print(name)
    printed = capsys.readouterr()
    assert (printed.out.count(name), printed.err) == (3, f"{name}\n")
