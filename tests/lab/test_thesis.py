"""The page of the thesis: complete, with the numbers of the kept tables, by commands that exist."""

import re

from typer.main import get_command

from lab.__main__ import app_of
from lab.catalogue import NAMES
from lab.thesis import NUMBERS, PAGE, filled, rows_of

N_FIGURES = {1: 2, 2: 1, 3: 3, 4: 13, 5: 11}
N_TABLES = {2: 2, 3: 1, 4: 3, 5: 1}


def test_the_numbers_of_the_page_are_those_of_the_kept_tables(root):
    page = (root / PAGE).read_text()
    assert filled(page, root / "docs" / "results") == page
    wrong = page.replace("0.032", "0.033")
    assert wrong != page
    assert filled(wrong, root / "docs" / "results") == page


def numbers_of(kind, rows):
    """Of figures or tables in the rows, as (4, 12); ranges are spelt out."""
    found = set()
    for item, *_ in rows:
        for part in re.findall(rf"{kind}s?\.? ((?:\d+\.\d+(?:–\d+\.\d+)?(?:, )?)+)", item):
            for name in part.strip(", ").split(", "):
                first, _, last = name.partition("–")
                chapter, begin = map(int, first.split("."))
                end = int(last.split(".")[1]) if last else begin
                found |= {(chapter, number) for number in range(begin, end + 1)}
    return found


def test_every_figure_and_table_has_a_row_with_a_command_or_what_there_is_in_its_place(root):
    rows = rows_of((root / PAGE).read_text())
    for kind, counts in (("Fig", N_FIGURES), ("Table", N_TABLES)):
        assert numbers_of(kind, rows) == {
            (chapter, number + 1) for chapter, count in counts.items() for number in range(count)
        }
    assert set(NUMBERS) <= {item for item, *_ in rows}
    for item, _, command, number, differs in rows:
        words = command.strip("`").split()
        assert words[:1] in ([], *([name] for name in NAMES)), item
        if words:
            get_command(app_of(words[0])).make_context(words[0], words[1:])
        assert differs, item
        assert bool(number) == (item in NUMBERS), item
        assert not number or words, item
