"""The kept figure of the hallway study is what the code draws of the kept table."""

from importlib.metadata import version

import pytest

from lab.experiments.study.hallway.run import redraw
from support.pixels import MOST_OTHER, share_of_other_pixels


@pytest.mark.skipif(version("matplotlib") < "3.11", reason="drawn by matplotlib 3.11")
def test_the_kept_figure_is_what_the_code_draws(root, finished_study):
    """If it fails: python -m lab hallway --figure 5.9, then python -m lab keep."""
    (drawn,) = redraw(["5.9"], finished_study)
    kept = root / "docs" / "results" / "hallway.png"
    assert share_of_other_pixels(kept, drawn) <= MOST_OTHER


def test_one_curve_that_moved_is_found(root, finished_study):
    """A twentieth more of one divergence in Figure 5.9."""
    file = finished_study / "figure_5_9.csv"
    table = file.read_text().splitlines()
    row = next(i for i, line in enumerate(table) if line.startswith("dynamics_divergence,8,MDCE S"))
    *words, median, upper = table[row].split(",")
    table[row] = ",".join([*words, f"{1.05 * float(median)}", upper])
    file.write_text("\n".join(table))
    (changed,) = redraw(["5.9"], finished_study)
    assert share_of_other_pixels(changed, root / "docs" / "results" / "hallway.png") > MOST_OTHER
