"""`python -m lab hallway` and the other studies: bad input, and the recorded command."""

import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lab.__main__ import app_of
from lab.command.study import _command
from lab.experiments.running.provenance import recorded
from serd_bag.errors import FileError
from serd_core.errors import SerdError


def study(*words):
    return CliRunner().invoke(app_of("hallway"), words)


def test_a_study_is_not_run_in_the_folder_of_another(tmp_path):
    with recorded(tmp_path, "python -m lab detour", None):
        pass
    result = study("--quick", "--output", str(tmp_path))
    assert isinstance(result.exception, SerdError)
    assert "holds results of 'python -m lab detour" in str(result.exception)
    assert not (tmp_path / "work").exists()


def test_a_file_in_the_place_of_the_folder_is_refused_before_anything_runs(tmp_path):
    (tmp_path / "afile").touch()
    result = study("--quick", "--output", str(tmp_path / "afile"))
    assert isinstance(result.exception, FileError)
    assert "a file of this name is in the way" in str(result.exception)


@pytest.mark.parametrize(
    ("text", "fault"),
    [("people: 0\n", "people"), ("arival: {episodes: 3}\n", "did you mean 'arrival'")],
)
def test_settings_that_cannot_be_are_refused_before_anything_runs(tmp_path, text, fault):
    config = tmp_path / "mine.yaml"
    config.write_text(text)
    result = study("--config", str(config), "--output", str(tmp_path / "out"))
    assert isinstance(result.exception, FileError)
    assert fault in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_the_recorded_command_quotes_files_whose_names_have_spaces():
    own = ["a table.txt", "--mapping", "my mapping.yaml"]
    command = _command("people", own, Path("an output"), quick=True, config=Path("a config.yaml"))
    assert shlex.split(command) == [
        *("python", "-m", "lab", "people", *own, "--quick"),
        *("--config", "a config.yaml", "--output", "an output"),
    ]
