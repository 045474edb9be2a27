"""The page and the figure of the hallway study have what the kept table has."""

import re
from importlib.metadata import version

import pytest

from lab.experiments.running.tables import read_table
from lab.experiments.study.hallway.figure import draw
from lab.experiments.study.hallway.tables.page import PAGE, filled
from serd_app.report.style import save_figure
from support.pixels import MOST_OTHER, share_of_other_pixels


def test_the_learners_on_the_page_are_those_of_the_kept_table(root, finished_study):
    page = (root / PAGE).read_text()
    assert page.count("<!-- table ") == page.count("<!-- end -->") == 9
    block = re.search(r"<!-- table measures -->.*?<!-- end -->", page, re.S)[0]
    assert filled(block, finished_study) == block


@pytest.mark.skipif(version("matplotlib") < "3.11", reason="drawn by matplotlib 3.11")
def test_the_kept_figure_is_what_the_code_draws(root, finished_study):
    """If it fails: python -m lab hallway, then python -m lab keep."""
    drawn = finished_study / "drawn.png"
    save_figure(drawn, draw(read_table(finished_study / "figure_5_9.csv")))
    assert share_of_other_pixels(root / "docs" / "results" / "hallway.png", drawn) <= MOST_OTHER
