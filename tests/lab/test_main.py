"""`python -m lab`: its list, near names, and help of everything that it runs."""

import pytest
from typer.testing import CliRunner

from lab.__main__ import app_of, main
from lab.catalogue import BENCHMARKS, EXPERIMENTS, NAMES, STUDIES


def test_without_a_name_everything_is_listed_with_a_line(capsys):
    assert main([]) == 0
    lines = capsys.readouterr().out.splitlines()
    for name in NAMES:
        (line,) = [line for line in lines if line.startswith(f"  {name} ")]
        assert line.split(name, 1)[1].strip()
        assert len(line) <= 100


@pytest.mark.parametrize("name", NAMES)
def test_each_name_has_a_help(name):
    shown = CliRunner().invoke(app_of(name), ["--help"])
    assert shown.exit_code == 0, shown.output
    assert "Usage:" in shown.output
    # Runs of long work can be sent to other machines.
    assert ("--jobs" in shown.output) == (name in {*STUDIES, *EXPERIMENTS, "faults"})


def test_the_module_of_each_benchmark_is_listed(root):
    defining = {
        ".".join(path.relative_to(root).with_suffix("").parts)
        for path in (root / "lab" / "benchmarks").rglob("*.py")
        if "\ndef run(" in path.read_text()
    }
    assert {work.module for work in BENCHMARKS.values()} == defining


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["hallwya"], "no experiment or benchmark is named 'hallwya'; did you mean 'hallway'?"),
        (["bench", "gradeint"], "got 'gradeint'; did you mean 'gradient'?"),
        (["gridworld", "--temperature", "hot"], "temperature must be a number"),
    ],
)
def test_an_error_is_one_line_with_exit_code_2(words, sentence, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    errors = capsys.readouterr().err
    assert errors.startswith("lab: ")
    assert errors.count("\n") == 1
    assert sentence in errors
