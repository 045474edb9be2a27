import shutil

import pytest

from lab.experiments.study.products import SETTINGS_YAML
from lab.experiments.study.settings import study_settings
from storage.yaml_config import model_yaml


@pytest.fixture
def finished_study(root, tmp_path):
    """The folder of a hallway study that has the table which the documents keep."""
    shutil.copy(root / "docs" / "results" / "hallway.csv", tmp_path / "figure_5_9.csv")
    (tmp_path / SETTINGS_YAML).write_text(model_yaml(study_settings()))
    return tmp_path
