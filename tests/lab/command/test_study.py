"""`python -m lab hallway`: figures out of kept tables, and bad input."""

import json
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lab.__main__ import app_of
from lab.command.study import _command
from lab.experiments.running.provenance import recorded
from lab.experiments.study.hallway.run import redraw
from serd_bag.errors import FileError
from serd_core.errors import SerdError


def study(*words):
    return CliRunner().invoke(app_of("hallway"), words)


def test_a_figure_is_drawn_again_from_the_tables(finished_study):
    result = study("--figure", "5.9", "--output", str(finished_study))
    assert result.exit_code == 0, result.output
    drawn = finished_study / "figure_5_9.png"
    assert Path(result.output.strip()) == drawn
    assert drawn.with_suffix(".svg").exists()
    content = drawn.read_bytes()
    assert redraw(["5.9"], finished_study) == [drawn]
    assert drawn.read_bytes() == content


def test_a_figure_drawn_again_is_printed_as_json(finished_study):
    result = study("--figure", "5.9", "--output", str(finished_study), "--json")
    assert json.loads(result.output) == {"pictures": [str(finished_study / "figure_5_9.png")]}


def test_a_mistyped_folder_of_a_figure_is_refused(tmp_path):
    result = study("--figure", "5.8", "--output", str(tmp_path / "stdy"))
    assert isinstance(result.exception, SerdError)
    assert "--output must be a folder that exists with --figure" in str(result.exception)
    assert not (tmp_path / "stdy").exists()


def test_a_figure_is_not_drawn_into_the_folder_of_another_study(tmp_path):
    with recorded(tmp_path, "python -m lab detour", None):
        pass
    result = study("--figure", "5.8", "--output", str(tmp_path))
    assert isinstance(result.exception, SerdError)
    assert "holds results of 'python -m lab detour" in str(result.exception)
    assert not (tmp_path / "figure_5_8.png").exists()


def test_a_file_in_the_place_of_the_folder_is_refused_before_anything_runs(tmp_path):
    (tmp_path / "afile").touch()
    result = study("--quick", "--output", str(tmp_path / "afile"))
    assert isinstance(result.exception, FileError)
    assert "a file of this name is in the way" in str(result.exception)


def test_a_figure_without_the_tables_of_a_study_is_refused(tmp_path):
    result = study("--figure", "5.8", "--output", str(tmp_path))
    assert isinstance(result.exception, SerdError)
    assert f"{tmp_path} must hold a finished study, but has no settings.yaml" in str(
        result.exception
    )


def test_an_unknown_figure_is_refused_with_the_nearest_one(tmp_path):
    result = study("--figure", "5.99", "--output", str(tmp_path))
    assert isinstance(result.exception, SerdError)
    assert "figure must be one of 5.5" in str(result.exception)
    assert "did you mean '5.9'" in str(result.exception)


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


def test_a_file_of_people_that_is_not_there_is_refused_by_its_path(tmp_path):
    words = [str(tmp_path / "none.txt"), "--output", str(tmp_path / "out")]
    result = CliRunner().invoke(app_of("people"), words)
    assert isinstance(result.exception, FileError)
    assert "none.txt: it does not exist" in str(result.exception)


def test_the_recorded_command_quotes_files_whose_names_have_spaces():
    own = ["a table.txt", "--mapping", "my mapping.yaml"]
    command = _command("people", own, Path("an output"), quick=True, config=Path("a config.yaml"))
    assert shlex.split(command) == [
        *("python", "-m", "lab", "people", *own, "--quick"),
        *("--config", "a config.yaml", "--output", "an output"),
    ]
