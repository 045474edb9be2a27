"""What documents keep of results: written and compared by commands; the figure is what is drawn."""

import shutil
from importlib.metadata import version

import numpy as np
import pandas as pd
import pytest
import yaml
from PIL import Image

from lab.__main__ import main
from lab.experiments.running.provenance import recorded
from lab.experiments.study.hallway.figure import draw
from serd_app.report.style import save_figure
from support.pixels import MOST_OTHER, share_of_other_pixels


def test_what_is_kept_is_compared_and_a_change_is_found(root, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(root / "docs" / "results", tmp_path / "docs" / "results")
    for name in ("thesis.md", "hallway_study.md"):
        shutil.copy(root / "docs" / name, tmp_path / "docs")
    results, kept = tmp_path / "lab" / "results", tmp_path / "docs" / "results"
    with recorded(results / "ascents", "python -m lab ascents", None):
        (results / "ascents").mkdir(parents=True)
        shutil.copy(kept / "ascents.csv", results / "ascents" / "costs.csv")
    shades = np.arange(64 * 96 * 3).reshape(64, 96, 3).astype(np.uint8)
    Image.fromarray(shades).save(results / "ascents" / "gaps.png")
    assert main(["keep"]) == 0
    (run,) = yaml.safe_load((kept / "provenance.yaml").read_text())["ascents"]
    assert run["command"] == "python -m lab ascents"
    with Image.open(kept / "ascents.png") as picture:
        assert picture.size == (96, 64)
    assert main(["check"]) == 0
    costs = results / "ascents" / "costs.csv"
    costs.write_text(costs.read_text().replace("20000", "10000"))
    capsys.readouterr()
    assert main(["check"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert "differs     docs/results/ascents.csv" in lines
    assert "no results  docs/results/robots.csv" in lines
    assert main(["keep"]) == 0
    assert main(["check"]) == 0
    assert "after 10000 steps" in (tmp_path / "docs" / "thesis.md").read_text()


@pytest.mark.skipif(version("matplotlib") < "3.11", reason="drawn by matplotlib 3.11")
def test_the_kept_figure_is_what_the_code_draws(root, tmp_path):
    """If it fails: python -m lab hallway, then python -m lab keep."""
    kept = root / "docs" / "results"
    save_figure(tmp_path / "drawn.png", draw(pd.read_csv(kept / "hallway.csv")))
    assert share_of_other_pixels(kept / "hallway.png", tmp_path / "drawn.png") <= MOST_OTHER
