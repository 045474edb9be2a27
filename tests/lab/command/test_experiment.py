"""`python -m lab NAME`: settings as options, results as files, faults as sentences."""

import re
import shlex

import pytest
import yaml

from lab.__main__ import app_of
from lab.command.experiment import _text
from serd_files.errors import USER_ERRORS


def run(name, *words):
    app_of(name)(words, standalone_mode=False)


def test_an_experiment_leaves_its_tables_and_figures(tmp_path, capsys):
    folder = tmp_path / "out"
    run("priors", "--points", "11", "--n-angles", "36", "--output", str(folder))
    assert (folder / "surfaces.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "optimal_distributions.csv").read_text().count("\n") > 4
    assert capsys.readouterr().out.splitlines()[-1] == f"results: {folder}"


def test_an_experiment_notes_its_command_beside_its_results(tmp_path):
    folder = tmp_path / "out"
    words = ["priors", "--n-points", "11", "--n-angles", "36"]
    run(*words, "--output", str(folder))
    (noted,) = yaml.safe_load((folder / "provenance.yaml").read_text())["runs"]
    assert noted["command"] == shlex.join(
        [
            "python",
            "-m",
            "lab",
            *words,
            "--jobs",
            "-1",
            "--backend",
            "loky",
            "--output",
            str(folder),
        ]
    )
    assert "n_points=11" in noted["settings"]
    assert noted["finished"]


def test_work_of_another_version_of_the_code_is_named(tmp_path, capsys):
    words = ["priors", "--points", "5", "--angles", "8", "--output", str(tmp_path / "out")]
    run(*words)
    noted = tmp_path / "out" / "provenance.yaml"
    noted.write_text(re.sub(r"commit: \w+", f"commit: {'c' * 40}", noted.read_text()))
    capsys.readouterr()
    run(*words)
    assert "holds results of ccccccc, which are kept; delete the folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("rust",), "--data must be given for rust: the folder of Rust's odometer files"),
        (("rust", "--data", ".", "--bins", "many"), "n_bins must be an integer, .*, got 'many'"),
        (("priors", "--address", "tcp://127.0.0.1:8786"), "left out with loky, .*; choose dask"),
        (("priors", "--backend", "spam"), "backend must be one of .* got 'spam'"),
        (("gridworld", "--discount", "1"), "discount must be less than 1, got '1'"),
        (("gridworld", "--seed", "-1"), "seed must be greater than or equal to 0, got '-1'"),
        (("priors", "--extent", "wide"), "extent must be a number, .*, got 'wide'"),
    ],
)
def test_a_wrong_setting_gets_a_sentence(words, sentence, tmp_path):
    with pytest.raises(USER_ERRORS, match=sentence):
        run(*words, "--output", str(tmp_path))


def test_a_file_in_the_place_of_the_folder_gets_a_sentence(tmp_path):
    (tmp_path / "afile").touch()
    with pytest.raises(USER_ERRORS, match="afile: a file of this name is in the way; move it away"):
        run("priors", "--output", str(tmp_path / "afile"))


def test_small_numbers_keep_their_digits():
    assert [_text(value) for value in (None, 7, -0.0, -1.234e-8, -3304.1548)] == [
        "", "7", "0.0000", "-1.23e-08", "-3304.1548",
    ]  # fmt: skip
