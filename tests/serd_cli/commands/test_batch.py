"""`serd batch`: many episodes, one row each."""

import signal
import subprocess
import sys

import pytest

from serd_files.table import RowTable
from serd_sim.episodes.batch import COLUMNS
from support.waiting import PATIENCE_S, wait_until

SMALL = ("batch", "--scenario", "crossing", "--people", "4", "--jobs", "1")


def test_a_batch_writes_a_table_and_tells_what_came_of_it(serd, tmp_path):
    output = tmp_path / "episodes.csv"
    summary = serd(*SMALL, "--seeds", "2", "--output", output, "--json").values
    assert summary["table"] == str(output)
    (condition,) = summary["conditions"]
    assert (condition["n_episodes"], condition["n_people"]) == (2, 4)
    assert condition["n_arrived"] == 2
    assert len(output.read_text().splitlines()) == 3


def test_more_seeds_add_to_the_table_and_keep_what_is_there(serd, tmp_path):
    output = tmp_path / "episodes.csv"
    serd(*SMALL, "--seeds", "1", "--output", output)
    ended = serd(*SMALL, "--seeds", "2", "--output", output)
    assert "2 of 2" in ended.out
    assert list(RowTable(output, COLUMNS, ["seed"]).rows) == [("1",), ("2",)]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--output", "rows.txt"), "must end in .csv, got rows.txt; rename it to rows.csv"),
        (("--output", "r.csv", "--policy", "expart"), "did you mean 'expert'?"),
        (("--output", "r.csv", "--policy", "none.yaml"), "none.yaml"),
        (("--output", "r.csv", "--planner", "dva"), "did you mean 'dwa'?"),
        (("--output", "r.csv", "--start-area", "transfr"), "did you mean 'transfer'?"),
        (("--output", "r.csv", "--people", "-1"), "number of people must be at least 0, got -1"),
        (("--output", "r.csv", "--seeds", "0"), "--seeds must be at least 1"),
        (
            ("--output", "r.csv", "--seeds", "2000000000"),
            "at most 100000, got 2000000000; run them",
        ),
        (("--output", "r.csv", "--backend", "loki"), "did you mean 'loky'?"),
    ],
)
def test_bad_input_gets_a_sentence_and_exit_code_2(serd, words, sentence, tmp_path):
    ended = serd("batch", "--scenario", "hallway", *words)
    assert ended.code == 2
    assert sentence in ended.err
    assert ended.out == ""
    assert "episodes" not in ended.err, "no bar before everything is found to be in order"
    assert not list((tmp_path / "here").iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_an_interrupted_batch_keeps_its_rows_and_ends_with_130(tmp_path):
    output = tmp_path / "rows.csv"
    command = [sys.executable, "-m", "serd_cli.main", "batch", "--scenario", "crossing"]
    command += ["--people", "4", "--seeds", "2000", "--jobs", "2", "--output", str(output)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            wait_until(lambda: output.exists() and len(output.read_text().splitlines()) > 1)
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=PATIENCE_S)
        finally:
            process.kill()  # its workers end with it
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert f"results are in {output}; rerun the command to resume" in errors
    assert 1 < len(output.read_text().splitlines()) < 2001
