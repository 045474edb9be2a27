"""The page of the study has the numbers of its kept tables."""

from pathlib import Path

import pytest

from lab.experiments.study.hallway.run import KEPT
from lab.experiments.study.hallway.tables.page import filled
from serd_core.errors import SerdError

PAGE = Path(__file__).parents[6] / "docs" / "hallway_study.md"


def test_the_tables_of_the_page_are_those_of_the_kept_results():
    page = PAGE.read_text()
    assert page.count("<!-- table ") == page.count("<!-- end -->") == 10
    assert filled(page, KEPT) == page


def test_an_unknown_table_is_refused():
    with pytest.raises(SerdError, match="table must be one of recordings, reference"):
        filled("<!-- table nothing -->\n<!-- end -->", KEPT)
