"""`python -m lab NAME`: settings as options, results as files, faults as sentences."""

import shlex

import pytest
import yaml

from lab.__main__ import app_of
from serd_files.errors import USER_ERRORS


def run(name, *words):
    app_of(name)(words, standalone_mode=False)


def test_an_experiment_leaves_its_tables_and_figures(tmp_path, capsys):
    folder = tmp_path / "out"
    run("priors", "--angles", "36", "--output", str(folder))
    assert (folder / "optimal_distributions.csv").read_text().count("\n") > 4
    assert capsys.readouterr().out.splitlines()[-1] == f"results: {folder}"


def test_an_experiment_notes_its_command_beside_its_results(tmp_path):
    folder = tmp_path / "out"
    words = ["priors", "--n-angles", "36"]
    run(*words, "--output", str(folder))
    (noted,) = yaml.safe_load((folder / "provenance.yaml").read_text())["runs"]
    assert noted["command"] == shlex.join(
        [
            *("python", "-m", "lab"),
            *words,
            *("--jobs", "-1", "--backend", "loky", "--output"),
            str(folder),
        ]
    )
    assert "n_angles=36" in noted["settings"]
    assert noted["finished"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("rust",), "--data must be given for rust: the folder of Rust's odometer files"),
        (("rust", "--data", ".", "--bins", "many"), "n_bins must be an integer, .*, got 'many'"),
        (("priors", "--address", "tcp://127.0.0.1:8786"), "left out with loky, .*; choose dask"),
        (("priors", "--backend", "spam"), "backend must be one of .* got 'spam'"),
        (("gridworld", "--discount", "1"), "discount must be less than 1, got '1'"),
        (("gridworld", "--seed", "-1"), "seed must be greater than or equal to 0, got '-1'"),
        (("gridworld", "--temperature", "hot"), "temperature must be a number, .*, got 'hot'"),
    ],
)
def test_a_wrong_setting_gets_a_sentence(words, sentence, tmp_path):
    with pytest.raises(USER_ERRORS, match=sentence):
        run(*words, "--output", str(tmp_path))
