"""Batches: one row per episode, resumable, the same over processes."""

import subprocess
import sys
from pathlib import Path

import pytest

from serd_files.errors import USER_ERRORS
from serd_files.table import RowTable
from serd_files.yaml_config import model_yaml
from serd_sim.episodes.batch import COLUMNS, TASK_COLUMNS, EpisodeTask, run_batch, run_task
from serd_sim.episodes.execution import Execution
from serd_sim.scenario.scenario import load_scenario
from support.waiting import wait_until

ONE = Execution(1)
TASKS = [EpisodeTask("crossing", seed, n_people=6) for seed in (1, 2)]


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    path = tmp_path_factory.mktemp("batch") / "episodes.csv"
    progress = []
    rows = run_batch(
        TASKS, path, execution=Execution(2), on_progress=lambda *done: progress.append(done)
    )
    return path, rows, progress


def test_every_task_has_its_row_with_numbers_also_from_another_process(table):
    _, rows, progress = table
    assert [row["seed"] for row in rows] == [1, 2]
    for row in rows:
        assert row["outcome"] == "arrived"
        assert 10 < row["time_of_arrival_s"] < 200
        assert 0 <= row["intimate_share"] <= row["personal_share"] <= 1
    assert progress == [(0, 2), (1, 2), (2, 2)]
    here = run_task(TASKS[1])
    assert {name: value for name, value in rows[1].items() if name in here} == here


def test_a_batch_that_is_started_again_with_tasks_listed_twice_runs_nothing(table):
    path, rows, _ = table
    before, progress = path.read_bytes(), []
    assert rows == run_batch(TASKS * 2, path, on_progress=lambda *done: progress.append(done))
    assert progress == [(2, 2)]
    assert path.read_bytes() == before


KILLED_PROGRAM = """
import sys
from serd_sim.episodes.batch import EpisodeTask, run_batch
from serd_sim.episodes.execution import Execution

tasks = [EpisodeTask("crossing", seed, n_people=6) for seed in range(1000)]
run_batch(tasks, sys.argv[1], execution=Execution(2))
"""


def stat_of(folder):
    """(state, parent) of a process in /proc; ('Z', '0') where there is none."""
    try:
        return (folder / "stat").read_text().rsplit(")", 1)[1].split()[:2]
    except OSError:
        return "Z", "0"


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_a_batch_that_is_killed_leaves_no_worker_behind_and_goes_on_where_it_was(tmp_path):
    path = tmp_path / "rows.csv"
    command = [sys.executable, "-c", KILLED_PROGRAM, str(path)]
    with subprocess.Popen(command) as process:
        wait_until(lambda: path.exists() and len(path.read_text().splitlines()) > 1)
        processes = Path("/proc").glob("[0-9]*")
        workers = [each for each in processes if stat_of(each)[1] == str(process.pid)]
        process.kill()
    assert len(workers) >= 2
    wait_until(lambda: all(stat_of(each)[0] == "Z" for each in workers))
    rows = RowTable(path, COLUMNS, TASK_COLUMNS).rows.values()
    assert {row["outcome"] for row in rows} == {"arrived"}


def test_episodes_of_another_version_of_a_scenario_file_are_not_taken_for_this_one(tmp_path):
    file, path = tmp_path / "mine.yaml", tmp_path / "rows.csv"
    mine = load_scenario("crossing").with_pedestrian_count(0)
    file.write_text(model_yaml(mine))
    run_batch([EpisodeTask(str(file), 1)], path, execution=ONE)
    file.write_text(model_yaml(mine.model_copy(update={"episode_timeout_s": 30.0})))
    with pytest.raises(USER_ERRORS, match=r"another version of .*mine.yaml.*; choose another file"):
        run_batch([EpisodeTask(str(file), 1)], path, execution=ONE)


@pytest.mark.parametrize(
    ("task", "sentence"),
    [
        (EpisodeTask("crosing", 1), "did you mean 'crossing'"),
        (EpisodeTask("crossing", 1, start_area="trian"), "did you mean 'train'"),
        (EpisodeTask("crossing", 1, driver="none.yaml"), "none.yaml"),
        (EpisodeTask("crossing", 1, people_from="scans"), "did you mean 'scan'"),
    ],
)
def test_a_bad_name_is_said_before_anything_runs(tmp_path, task, sentence):
    with pytest.raises(USER_ERRORS, match=sentence):
        run_batch([*TASKS, task], tmp_path / "rows.csv", execution=ONE)
    assert not list(tmp_path.iterdir())


def test_a_row_says_where_people_were_known_from_and_how_the_planner_fared():
    given, row = (
        run_task(EpisodeTask("crossing", 1, n_people=24, people_from=source))
        for source in ("given", "scan")
    )
    assert (row["people_from"], row["outcome"]) == ("scan", "arrived")
    assert (row["planner_status"], row["n_recoveries"]) == ("NONE", 0)
    assert row["distance_m"] != given["distance_m"]


def test_a_row_gives_the_reason_of_a_failure_in_nav2s_words(tmp_path):
    """A thin bar leaves a gap too narrow for the robot, and no cell's centre is inside it."""
    file = tmp_path / "blocked.yaml"
    file.write_text("""
name: blocked
episode_timeout_s: 60
walkable_area_m: [[0, 0], [8, 0], [8, 2], [0, 2]]
obstacles: [{name: bar, outline_m: [[4, -0.1], [4.05, -0.1], [4.05, 1.8], [4, 1.8]]}]
goal_area_m: [[6, 0], [8, 0], [8, 2], [6, 2]]
start_areas_m: {train: [[0, 0], [2, 0], [2, 2], [0, 2]]}
pedestrians: {count: 0}
""")
    row = run_task(EpisodeTask(str(file), 1))
    assert row["outcome"] == "timeout"
    assert row["planner_status"] == "FAILED_TO_MAKE_PROGRESS"
    assert row["n_recoveries"] > 3
    assert row["robot_on_wall"] == 0
