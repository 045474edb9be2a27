"""The kept figure of the hallway study is what the code draws of the kept table."""

from importlib.metadata import version

import pytest

from lab.experiments.running.tables import read_table
from lab.experiments.study.hallway.figure import draw
from serd_app.report.style import save_figure
from support.pixels import MOST_OTHER, share_of_other_pixels


def drawn(folder):
    """The picture of the table in a folder."""
    picture = folder / "figure_5_9.png"
    save_figure(picture, draw(read_table(picture.with_suffix(".csv"))))
    return picture


@pytest.mark.skipif(version("matplotlib") < "3.11", reason="drawn by matplotlib 3.11")
def test_the_kept_figure_is_what_the_code_draws(root, finished_study):
    """If it fails: python -m lab hallway, then python -m lab keep."""
    kept = root / "docs" / "results" / "hallway.png"
    assert share_of_other_pixels(kept, drawn(finished_study)) <= MOST_OTHER


def test_one_curve_that_moved_is_found(root, finished_study):
    """A twentieth more of one divergence in Figure 5.9."""
    file = finished_study / "figure_5_9.csv"
    table = file.read_text().splitlines()
    row = next(i for i, line in enumerate(table) if line.startswith("dynamics_divergence,8,MDCE S"))
    *words, median, upper = table[row].split(",")
    table[row] = ",".join([*words, f"{1.05 * float(median)}", upper])
    file.write_text("\n".join(table))
    kept = root / "docs" / "results" / "hallway.png"
    assert share_of_other_pixels(drawn(finished_study), kept) > MOST_OTHER
