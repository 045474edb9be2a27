"""Batches: one row per episode, resumable, the same over processes."""

import math
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from serd_core.errors import SerdError
from sim.batch import EpisodeTask, run_batch, run_task
from sim.drivers import driver_names, make_driver
from sim.scenario import load_scenario

TASKS = [EpisodeTask("crossing", seed, n_people=6) for seed in (1, 2)]


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    path = tmp_path_factory.mktemp("batch") / "episodes.csv"
    progress = []
    rows = run_batch(TASKS, path, n_processes=1, on_progress=lambda *done: progress.append(done))
    return path, rows, progress


def test_every_task_has_its_row_with_numbers(table):
    _, rows, progress = table
    assert [row["seed"] for row in rows] == [1, 2]
    assert all(row["outcome"] == "arrived" for row in rows)
    assert all(10 < row["time_of_arrival_s"] < 200 for row in rows)
    assert all(0 <= row["intimate_share"] <= row["personal_share"] <= 1 for row in rows)
    assert progress == [(1, 2), (2, 2)]


def test_a_batch_that_is_started_again_runs_nothing_and_gives_the_same_rows(table):
    path, rows, _ = table
    before = path.read_bytes()
    progress = []
    again = run_batch(TASKS, path, n_processes=1, on_progress=lambda *done: progress.append(done))
    assert again == rows
    assert progress == []
    assert path.read_bytes() == before


def test_a_line_cut_short_by_a_crash_is_run_again(table, tmp_path):
    path, rows, _ = table
    torn = tmp_path / "torn.csv"
    torn.write_bytes(path.read_bytes()[:-20])
    again = run_batch(TASKS, torn, n_processes=1)
    assert again == rows
    assert torn.read_bytes() == path.read_bytes()


def test_processes_give_the_rows_that_one_process_gives(table, tmp_path):
    _, rows, _ = table
    assert run_batch(TASKS, tmp_path / "two.csv", n_processes=2) == rows


def test_any_executor_gives_the_same_rows(table, tmp_path):
    _, rows, _ = table
    with ThreadPoolExecutor(1) as executor:
        assert run_batch(TASKS, tmp_path / "three.csv", executor=executor) == rows


KILLED_PROGRAM = """
import multiprocessing, sys, threading, time
from sim.batch import EpisodeTask, run_batch

def tell():
    while len(multiprocessing.active_children()) < 2:
        time.sleep(0.05)
    print(*(child.pid for child in multiprocessing.active_children()), flush=True)

if __name__ == "__main__":
    threading.Thread(target=tell, daemon=True).start()
    run_batch([EpisodeTask("hallway", seed) for seed in range(200)], sys.argv[1], n_processes=2)
"""


def is_running(pid):
    """Whether a process is there and no zombie."""
    status = Path(f"/proc/{pid}/stat")
    return status.exists() and status.read_text().rsplit(")", 1)[1].split()[0] != "Z"


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_a_batch_that_is_killed_leaves_no_worker_behind(tmp_path):
    program = tmp_path / "killed.py"
    program.write_text(KILLED_PROGRAM)
    with subprocess.Popen(
        [sys.executable, str(program), str(tmp_path / "rows.csv")],
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        workers = [int(pid) for pid in process.stdout.readline().split()]
        time.sleep(2.0)
        process.kill()
    assert len(workers) == 2
    deadline = time.monotonic() + 20.0
    while any(is_running(pid) for pid in workers) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not any(is_running(pid) for pid in workers)


def test_a_file_that_is_no_table_of_episodes_is_refused(tmp_path):
    path = tmp_path / "other.csv"
    path.write_text("a,b\n1,2\n")
    with pytest.raises(SerdError, match="has no column 'scenario'; choose another file"):
        run_batch(TASKS, path)


def test_an_episode_is_the_same_when_run_alone(table):
    _, rows, _ = table
    row = run_task(TASKS[0])
    assert row["time_of_arrival_s"] == rows[0]["time_of_arrival_s"]
    assert math.isclose(row["distance_m"], rows[0]["distance_m"], rel_tol=0.0)


def test_drivers_are_known_by_name():
    scenario = load_scenario("corridor")
    assert {"expert", "expert_with_flow", "expert_against_flow"} == set(driver_names())
    with pytest.raises(SerdError, match="did you mean 'expert'"):
        make_driver("experts", scenario, 1)
