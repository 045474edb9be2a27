import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from lab.__main__ import main
from lab.experiments.study.products import SETTINGS_YAML
from lab.experiments.study.settings import study_settings
from serd_files.yaml_config import model_yaml
from support.commands import Ended, work_in_empty_folder


@pytest.fixture
def lab(monkeypatch, capsys, tmp_path) -> Callable[..., Ended]:
    """Runs `python -m lab` with some words in an empty folder."""
    work_in_empty_folder(monkeypatch, tmp_path)

    def run(*words: str | Path) -> Ended:
        return Ended(main([*map(str, words)]), *capsys.readouterr())

    return run


@pytest.fixture
def finished_study(root, tmp_path):
    """The folder of a hallway study that has the table which the documents keep."""
    shutil.copy(root / "docs" / "results" / "hallway.csv", tmp_path / "figure_5_9.csv")
    (tmp_path / SETTINGS_YAML).write_text(model_yaml(study_settings()))
    return tmp_path
