"""The page of the thesis: complete, with the numbers of the kept tables, by commands that exist."""

import re

import pytest

from lab.catalogue import NAMES
from lab.thesis import PAGE, SHOWN, filled

N_FIGURES = {1: 2, 2: 1, 3: 3, 4: 13, 5: 11}
N_TABLES = {2: 2, 3: 1, 4: 3, 5: 1}


def test_the_numbers_of_the_page_are_those_of_the_kept_tables(root):
    page = (root / PAGE).read_text()
    assert filled(page, root / "docs" / "results") == page


def numbers_of(kind):
    """Of figures or tables in the rows, as (4, 12); ranges are spelt out."""
    found = set()
    for shown in SHOWN:
        for part in re.findall(rf"{kind}s?\.? ((?:\d+\.\d+(?:–\d+\.\d+)?(?:, )?)+)", shown.item):
            for name in part.strip(", ").split(", "):
                first, _, last = name.partition("–")
                chapter, begin = map(int, first.split("."))
                end = int(last.split(".")[1]) if last else begin
                found |= {(chapter, number) for number in range(begin, end + 1)}
    return found


@pytest.mark.parametrize(("kind", "counts"), [("Fig", N_FIGURES), ("Table", N_TABLES)])
def test_every_figure_and_table_of_the_thesis_has_a_row(kind, counts):
    assert numbers_of(kind) == {
        (chapter, number + 1) for chapter, count in counts.items() for number in range(count)
    }


def test_each_row_has_a_command_that_exists_or_says_what_there_is_in_its_place():
    for shown in SHOWN:
        assert shown.words.split()[:1] in ([], *([name] for name in NAMES)), shown.item
        assert shown.differs, shown.item
        assert not shown.table or shown.words, shown.item
