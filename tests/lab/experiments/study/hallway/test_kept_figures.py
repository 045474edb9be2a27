"""The kept figures of the hallway study are what the code draws of the kept tables."""

from importlib.metadata import version

import pytest

from lab.experiments.running.tables import read_table
from lab.experiments.study.hallway.figures.catalogue import FIGURES, figure_of
from lab.experiments.study.hallway.run import KEPT, redraw
from lab.experiments.study.products import SETTINGS_YAML
from lab.experiments.study.settings import StudySettings
from lab.experiments.study.study import Study
from report.style import save_figure
from storage.yaml_config import load_yaml_model
from support.pixels import MOST_OTHER, share_of_other_pixels


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """As PNG only, which is what is kept."""
    folder = tmp_path_factory.mktemp("figures")
    study = Study(load_yaml_model(KEPT / SETTINGS_YAML, StudySettings), KEPT / "work")
    for figure in FIGURES:
        drawn = figure.draw(read_table(KEPT / f"{figure.stem}.csv"), study)
        save_figure(folder / f"{figure.stem}.png", drawn)
    return folder


@pytest.mark.skipif(version("matplotlib") < "3.11", reason="drawn by matplotlib 3.11")
@pytest.mark.parametrize("name", [figure.name for figure in FIGURES])
def test_a_kept_figure_is_what_the_code_draws(drawn, name):
    """If it fails: python -m lab hallway --figure NAME."""
    file = f"{figure_of(name).stem}.png"
    assert share_of_other_pixels(KEPT / file, drawn / file) <= MOST_OTHER


def test_one_curve_that_moved_is_found(drawn, tmp_path):
    """A twentieth more of one divergence in Figure 5.9."""
    file = figure_of("5.9").stem
    table = (KEPT / f"{file}.csv").read_text().splitlines()
    row = next(i for i, line in enumerate(table) if line.startswith("dynamics_divergence,8,MDCE S"))
    *words, median, upper = table[row].split(",")
    table[row] = ",".join([*words, f"{1.05 * float(median)}", upper])
    for name, text in ((f"{file}.csv", "\n".join(table)), ("settings.yaml", None)):
        (tmp_path / name).write_text(text or (KEPT / name).read_text())
    (changed,) = redraw(["5.9"], tmp_path, tmp_path)
    assert share_of_other_pixels(changed, drawn / f"{file}.png") > MOST_OTHER
