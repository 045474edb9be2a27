"""What documents keep of results: written and compared by commands, packed with provenance."""

import shutil
import tarfile
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

from lab.__main__ import main
from lab.experiments.running.provenance import recorded


@pytest.fixture
def results(root, tmp_path, monkeypatch):
    """A root with the project's documents, and results of one study and one benchmark."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(root / "docs" / "results", tmp_path / "docs" / "results")
    for name in ("thesis.md", "hallway_study.md"):
        shutil.copy(root / "docs" / name, tmp_path / "docs")
    folder = tmp_path / "lab" / "results"
    with recorded(folder / "ascents", "python -m lab ascents", None):
        (folder / "ascents").mkdir(parents=True)
        shutil.copy(root / "docs" / "results" / "ascents.csv", folder / "ascents" / "costs.csv")
    rows, columns = np.mgrid[:64, :96]
    shades = np.stack([4 * rows, 2 * columns, rows + columns], axis=2).astype(np.uint8)
    for name in ("ascents/gaps.png", "speed.png"):
        Image.fromarray(shades).save(folder / name)
    return folder


def test_what_is_kept_is_compared_and_a_change_is_found(results, capsys):
    assert main(["keep"]) == 0
    kept = results.parents[1] / "docs" / "results"
    (run,) = yaml.safe_load((kept / "provenance.yaml").read_text())["ascents"]
    assert run["command"] == "python -m lab ascents"
    assert main(["check"]) == 0
    costs = results / "ascents" / "costs.csv"
    costs.write_text(costs.read_text().replace("20000", "10000"))
    capsys.readouterr()
    assert main(["check"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert "differs     docs/results/ascents.csv" in lines
    assert "no results  docs/results/detour.csv" in lines
    assert "equal       docs/thesis.md" in lines  # it has the kept number
    assert main(["keep"]) == 0
    assert main(["check"]) == 0
    assert "10000 steps of gradient ascent" in Path("docs/thesis.md").read_text()


def test_an_archive_has_all_results_and_how_it_was_made(results, tmp_path, capsys):
    assert main(["archive", "out.tar.xz"]) == 0
    assert capsys.readouterr().out == f"4 files: {tmp_path / 'out.tar.xz'}\n"
    with tarfile.open(tmp_path / "out.tar.xz") as archive:
        content = {member.name: archive.extractfile(member).read() for member in archive}
    provenance = yaml.safe_load(content.pop("results/provenance.yaml"))
    assert provenance["command"] == "python -m lab archive out.tar.xz"
    assert {"commit", "python", "packages"} <= provenance.keys()
    assert provenance["files"] == len(content) == 4
    for name, packed in content.items():
        assert packed == (results.parent / name).read_bytes()
