"""`serd batch`: many episodes, one row each."""

import signal
import subprocess
import sys

from serd_files.table import RowTable
from serd_sim.episodes.batch import COLUMNS
from support.waiting import PATIENCE_S, wait_until

SMALL = ("batch", "--scenario", "crossing", "--people", "4", "--jobs", "1")


def test_a_batch_writes_a_table_and_more_seeds_add_to_it(serd, tmp_path):
    output = tmp_path / "episodes.csv"
    summary = serd(*SMALL, "--seeds", "1", "--output", output, "--json").values
    assert summary["table"] == str(output)
    (condition,) = summary["conditions"]
    assert (condition["n_episodes"], condition["n_people"], condition["n_arrived"]) == (1, 4, 1)
    assert len(output.read_text().splitlines()) == 2
    assert "2 of 2" in serd(*SMALL, "--seeds", "2", "--output", output).out
    assert list(RowTable(output, COLUMNS, ["seed"]).rows) == [("1",), ("2",)]


def test_an_interrupted_batch_keeps_its_rows_and_ends_with_130(tmp_path):
    output = tmp_path / "rows.csv"
    command = [sys.executable, "-m", "serd_cli.main", *SMALL[:-1], "2"]
    command += ["--seeds", "2000", "--output", str(output)]
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
