"""Batches: one row per episode, resumable, the same over processes."""

import math
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from serd_core.grid.grid import Action
from serd_files.errors import USER_ERRORS
from serd_files.table import RowTable
from serd_files.yaml_config import model_yaml
from serd_sim.episodes.batch import (
    COLUMNS,
    TASK_COLUMNS,
    EpisodeTask,
    run_batch,
    run_task,
    summarise,
)
from serd_sim.episodes.execution import Execution
from serd_sim.episodes.film import TopView, save_gif, save_png
from serd_sim.episodes.metrics import EpisodeMetrics, MetricsObserver, time_to_collision_s
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import STOP, Command
from serd_sim.world.world import HallwayWorld
from support.observations import observation_at
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


CORRIDOR = load_scenario("corridor")  # periods of 0.05 s; bodies touch at 0.5 m


def metrics_of(*ticks, commands=None):
    """Of (pose, speed, people, their velocities) at each tick."""
    observer = MetricsObserver(CORRIDOR)
    for number, (pose, speed_mps, *people) in enumerate(ticks):
        seen = observation_at(
            *pose,
            tick=number,
            speed_mps=speed_mps,
            **dict(zip(("people", "velocity"), people, strict=False)),
        )
        observer.see(seen, commands[number] if commands else STOP, Action.NORTH)
    return observer.metrics


def test_discs_that_drive_at_each_other_touch_after_the_gap_over_the_closing_speed():
    away = np.array([[3.0, 0.0], [3.0, 0.6], [3.0, 0.0], [0.4, 0.0], [0.0, 2.0]])
    velocity = np.array([[-1.0, 0.0], [-1.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    times = time_to_collision_s(away, velocity, reach_m=0.5)
    assert times.tolist() == [pytest.approx(2.5), math.inf, math.inf, 0.0, math.inf]
    grazing = time_to_collision_s(np.array([[3.0, 0.3]]), np.array([[-1.0, 0.0]]), 0.5)
    assert grazing[0] == pytest.approx(3.0 - 0.4)


def test_a_person_ahead_counts_once_the_bodies_would_touch_within_a_second():
    far = ((2.0, 5.0, math.pi / 2), 1.0, [(2.0, 8.0)], [(0.0, -1.0)])  # 2.5 m / 2 m/s
    near = ((2.0, 5.5, math.pi / 2), 1.0, [(2.0, 7.5)], [(0.0, -1.0)])  # 1.5 m / 2 m/s
    turned = ((2.0, 5.5, -math.pi / 2), 1.0, [(2.0, 7.5)], [(0.0, -1.0)])  # same velocity
    assert metrics_of(far, near, turned, far).collision_ahead_share == 0.25


def test_zones_of_a_person_are_gaps_between_the_bodies():
    gaps = [((2.0, 5.0, 0.0), 0.0, [(2.0 + 0.5 + gap, 5.0)], [(0.0, 0.0)]) for gap in (0.1, 0.9, 1)]
    metrics = metrics_of(*gaps, ((2.0, 5.0, 0.0), 0.0))
    assert metrics.intimate_share == 0.25
    assert metrics.personal_share == 0.5


def test_motions_and_commands_give_means_over_time():
    """The way is 3 m; turns go over the border of angles."""
    yaws, speeds = np.pi - np.array([0.1, -0.1, 0.1, 0.1]), (0.0, 0.04, 0.1, 0.1)
    commands = [Command(0.0, 0.0), Command(0.1, 1.0), Command(0.1, 0.5), Command(0.1, 0.5)]
    poses = [(2.0, 5.0 + n, math.remainder(yaw, math.tau)) for n, yaw in enumerate(yaws)]
    metrics = metrics_of(*zip(poses, speeds, strict=True), commands=commands)
    assert metrics.standing_share == 0.5
    assert metrics.mean_speed_mps == pytest.approx(0.06)
    assert metrics.mean_abs_jerk_mps3 == pytest.approx((0.02 + 0.06) / 2 / 0.05**2)
    assert metrics.path_irregularity_radpm == pytest.approx(0.4 / 3.0)
    assert metrics.mean_abs_acceleration_mps2 == pytest.approx(0.1 / 0.05 / 3)
    assert metrics.mean_abs_turn_acceleration_radps2 == pytest.approx(1.5 / 0.05 / 3)


HALLWAY = load_scenario("hallway").with_pedestrian_count(5)
RED, BLUE = 0, 2
VIEW = TopView(HALLWAY, pixels_per_m=20.0)


def pixel(frame, x_m, y_m):
    return frame[round((24.3 - y_m) * 20), round((x_m + 0.3) * 20)].astype(int)


def is_coloured(frame, first, by=60):
    """Pixels, or one, whose channel `first` is above its opposite by as much."""
    pixels = frame.astype(int)
    return pixels[..., first] > pixels[..., 2 - first] + by


@pytest.fixture(scope="module")
def seen():
    with HallwayWorld(HALLWAY, seed=1) as world:
        return [world.reset(0), *(world.step(Command(0.5, 0.0)) for _ in range(19))]


def test_robot_and_people_are_drawn_where_they_are():
    def frame_of(*people):
        return VIEW.frame_at([observation_at(3.0, 8.0, people=people)], 0)

    frame = frame_of([1.0, 2.0], [5.0, 20.0])
    assert frame.dtype == np.uint8
    assert is_coloured(pixel(frame, 3.0, 8.0), BLUE)
    places = ((1.0, 2.0), (5.0, 20.0), (2.0, 12.0))
    assert [is_coloured(pixel(frame, *each), RED) for each in places] == [True, True, False]
    np.testing.assert_array_equal(frame_of([100.0, 100.0], [-50.0, 3.0]), frame_of())


def test_png_and_gif_hold_the_frames(seen, tmp_path):
    frames = [VIEW.frame_at(seen, tick) for tick in range(0, 20, 5)]
    save_png(frames[0], tmp_path / "one.png")
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "one.png")), frames[0])
    save_gif(frames, tmp_path / "all.gif", frames_per_s=4.0)
    with Image.open(tmp_path / "all.gif") as movie:
        assert (movie.n_frames, movie.info["duration"]) == (4, 250)


def test_a_movie_without_frames_or_whose_frames_fail_leaves_nothing_behind(tmp_path):
    def failing():
        yield VIEW.frame_at([observation_at(3.0, 8.0)], 0)
        raise RuntimeError("no more")

    with pytest.raises(USER_ERRORS, match="record an episode first"):
        save_gif([], tmp_path / "none.gif")
    with pytest.raises(RuntimeError, match="no more"):
        save_gif(failing(), tmp_path / "half.gif")
    assert not list(tmp_path.iterdir())


def row_of(seed, outcome, time_s, **values):
    base = {
        **dict.fromkeys(("scenario", "start_area", "driver", "people_from"), "any"),
        "n_people": 30,
        "guarded": 1,
        "seed": seed,
        "outcome": outcome,
        "time_of_arrival_s": time_s,
        "distance_m": 20.0 + seed,
        "minimum_person_distance_m": 0.1 * seed,
        "robot_on_person": 0,
        "person_on_robot": seed,
        "robot_on_wall": 0,
        **{each.name: 0.5 for each in fields(EpisodeMetrics)},
    }
    return base | values


def test_a_summary_averages_over_the_episodes_of_a_condition():
    rows = [
        row_of(1, "arrived", 50.0),
        row_of(2, "arrived", 60.0),
        row_of(3, "timeout", math.nan),
    ]
    (summary,) = summarise(rows)
    assert summary.n_episodes == 3
    assert summary.n_arrived == 2
    assert summary.mean_time_of_arrival_s == pytest.approx(55.0)
    assert summary.mean_distance_m == pytest.approx(22.0)
    assert summary.person_on_robot == pytest.approx(2.0)
    assert summary.minimum_person_distance_m == pytest.approx(0.1)
    (late,) = summarise([row_of(1, "timeout", math.nan)])
    assert math.isnan(late.mean_time_of_arrival_s)
    # Closed form of the exact interval where all n arrive: it begins at 0.025 ** (1 / n).
    (all_in,) = summarise([row_of(seed, "arrived", 50.0) for seed in (1, 2, 3)])
    assert (all_in.arrival_low, all_in.arrival_high) == pytest.approx((0.025 ** (1 / 3), 1.0))
