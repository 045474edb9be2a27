"""Every folder of results lists the runs that wrote into it."""

import subprocess

import pytest
import yaml

from lab.experiments.running import provenance
from lab.experiments.running.provenance import (
    FILE_NAME,
    code_commit,
    recorded,
)
from serd_files.errors import USER_ERRORS

COMMANDS = "python -m lab hallway --quick", "python -m lab hallway"


def runs_in(folder):
    return yaml.safe_load((folder / FILE_NAME).read_text())["runs"]


def test_each_run_is_added_with_its_command_settings_and_duration(tmp_path):
    times_s = iter([10.0, 12.5, 20.0, 21.0])
    for command in COMMANDS:
        with recorded(tmp_path, command, {"seed": 3}, lambda: next(times_s)):
            pass
    assert [run["command"] for run in runs_in(tmp_path)] == list(COMMANDS)
    assert [run["seconds"] for run in runs_in(tmp_path)] == [2.5, 1.0]
    assert runs_in(tmp_path)[0]["settings"] == "{'seed': 3}"
    assert runs_in(tmp_path)[0]["packages"]["numpy"]


def test_an_interrupted_run_is_noted_as_one_and_a_refused_one_not_at_all(tmp_path):
    with pytest.raises(KeyboardInterrupt), recorded(tmp_path, COMMANDS[0], None):
        raise KeyboardInterrupt
    assert not runs_in(tmp_path)[0]["finished"]
    with pytest.raises(ValueError, match="refused"), recorded(tmp_path, COMMANDS[1], None):
        raise ValueError("refused")
    assert len(runs_in(tmp_path)) == 1


def test_the_commit_is_that_of_the_repository_and_says_where_files_differ(tmp_path):
    assert code_commit(tmp_path) is None
    identity = ["-c", "user.name=A", "-c", "user.email=a@example.org"]

    def git(*words):
        done = subprocess.run(
            ["git", "-C", str(tmp_path), *identity, *words], capture_output=True, check=True
        )
        return done.stdout.decode().strip()

    git("init", "-q")
    (tmp_path / "file").write_text("one")
    git("add", "file")
    git("commit", "-qm", "First")
    commit = git("rev-parse", "HEAD")
    assert code_commit(tmp_path) == commit
    (tmp_path / "untracked").write_text("results")
    assert code_commit(tmp_path) == commit
    (tmp_path / "file").write_text("two")
    assert code_commit(tmp_path) == f"{commit} + changes"


def test_a_folder_of_other_work_is_refused(tmp_path):
    with recorded(tmp_path, COMMANDS[0], None):
        pass
    other = recorded(tmp_path, "python -m lab people walkers.txt", None)
    with (
        pytest.raises(USER_ERRORS, match="holds results of 'python -m lab hallway --quick'"),
        other,
    ):
        raise AssertionError("tables would be overwritten")


@pytest.mark.parametrize(
    "damaged", [b"", b"[]", b"runs: 3", b"runs:\n- {command: serd}", b"runs: [3]", b"\xff", b"{"]
)
def test_a_damaged_list_of_runs_is_named(tmp_path, damaged):
    (tmp_path / FILE_NAME).write_bytes(damaged)
    with pytest.raises(USER_ERRORS, match=FILE_NAME):
        provenance.require_same_work(tmp_path, COMMANDS[0])
