"""The page of the study has the numbers of its results."""

import re
import shutil

import pytest

from lab.experiments.study.hallway.tables.page import PAGE, filled
from serd_files.errors import USER_ERRORS


def test_the_learners_on_the_page_are_those_of_the_kept_table(root, tmp_path):
    page = (root / PAGE).read_text()
    assert page.count("<!-- table ") == page.count("<!-- end -->") == 9
    block = re.search(r"<!-- table measures -->.*?<!-- end -->", page, re.S)[0]
    shutil.copy(root / "docs" / "results" / "hallway.csv", tmp_path / "figure_5_9.csv")
    assert filled(block, tmp_path) == block


def test_an_unknown_table_is_refused(tmp_path):
    with pytest.raises(USER_ERRORS, match="table must be one of recordings, reference"):
        filled("<!-- table nothing -->\n<!-- end -->", tmp_path)
