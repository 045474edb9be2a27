"""Runs go on where they stopped, list what wrote into a folder, and refuse other settings."""

from functools import partial

import pytest
import yaml

from lab.catalogue import experiment_named
from lab.experiments.running.experiment import settings_of_file
from lab.experiments.running.provenance import FILE_NAME, recorded
from lab.experiments.running.repetitions import run_repetitions
from lab.experiments.study.products import Stage, Task, make_products
from lab.experiments.study.settings import study_settings
from serd_bag.errors import FileError
from serd_files.errors import USER_ERRORS
from serd_sim.episodes.execution import Execution

ALONE = Execution(n_jobs=1)


def test_a_file_changes_what_it_names_and_options_change_it_again(tmp_path):
    path, experiment = tmp_path / "mine.yaml", experiment_named("minimum-example")
    path.write_text("n_sets: 7\nsizes: [1, 2]\n")
    config = experiment.make_config({**settings_of_file(path), "sizes": "3,5"})
    assert (config.n_sets, config.sizes) == (7, (3, 5))
    with pytest.raises(USER_ERRORS, match="n_setts is not a known key; did you mean 'n_sets'"):
        experiment.make_config({"n_setts": 7})
    path.write_text("- 7\n")
    with pytest.raises(USER_ERRORS, match="must hold settings as 'name: value', got \\[7\\]"):
        settings_of_file(path)


def test_a_file_changes_any_part_of_a_study_whose_sizes_must_grow(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("people: 7\nlearning: {repetitions: 3}\n")
    changed = study_settings(config=path)
    assert (changed.people, changed.learning.repetitions) == (7, 3)
    assert changed.learning.sizes == study_settings().learning.sizes
    for sizes in ("[1, 4]", "[4, 2]", "[2, 21]"):
        path.write_text(f"learning: {{sizes: {sizes}}}\n")
        with pytest.raises(FileError, match="sizes must grow from at least 2 to at most"):
            study_settings(config=path)


def runs_in(folder):
    return yaml.safe_load((folder / FILE_NAME).read_text())["runs"]


def test_each_run_is_added_with_its_duration_a_refused_one_not_and_other_work_is_refused(tmp_path):
    commands = "python -m lab hallway --quick", "python -m lab hallway"
    times_s = iter([10.0, 12.5, 20.0, 21.0])
    for command in commands:
        with recorded(tmp_path, command, {"seed": 3}, lambda: next(times_s)):
            pass
    with pytest.raises(ValueError, match="refused"), recorded(tmp_path, commands[1], None):
        raise ValueError("refused")
    found = [(run["command"], run["seconds"], run["settings"]) for run in runs_in(tmp_path)]
    assert found == [(commands[0], 2.5, "{'seed': 3}"), (commands[1], 1.0, "{'seed': 3}")]
    with pytest.raises(KeyboardInterrupt), recorded(tmp_path, commands[0], None):
        raise KeyboardInterrupt
    assert [run["finished"] for run in runs_in(tmp_path)] == [True, True, False]
    other = recorded(tmp_path, "python -m lab people walkers.txt", None)
    with (
        pytest.raises(USER_ERRORS, match="holds results of 'python -m lab hallway --quick'"),
        other,
    ):
        raise AssertionError("tables would be overwritten")


def test_finished_repetitions_are_not_run_again_and_rows_keep_their_order(tmp_path):
    ran = []

    def square(number):
        ran.append(number)
        return [{"number": number, "square": number**2}]

    def run(n, description="squares"):
        return run_repetitions(square, n, tmp_path, description, ALONE, lambda *_: None)

    run(3)
    assert run(5) == [{"number": n, "square": n * n} for n in range(5)]
    assert ran == [0, 1, 2, 3, 4]
    with pytest.raises(USER_ERRORS, match="holds results of another configuration"):
        run(1, "cubes")
    for damaged in (b"", b'[{"number": 0', b"\xff\xfe\x01", b"null", b"[" * 10**6):
        (tmp_path / "repetition_00001.json").write_bytes(damaged)
        with pytest.raises(USER_ERRORS, match=r"repetition_00001.json must hold .* delete it and"):
            run(5)


def test_products_are_made_once_and_those_of_other_settings_are_refused(tmp_path):
    def make(*makers, description="these settings"):
        made = tuple(Task(tmp_path / f"{n}.txt", maker) for n, maker in enumerate(makers))
        stage = Stage("writing", tmp_path, description, made, task_s=2.0)
        make_products([stage], ALONE, lambda *_: None)
        return stage

    def write(text, file):
        file.write_text(text)

    def interrupt(file):
        raise KeyboardInterrupt(file.name)

    with pytest.raises(KeyboardInterrupt):
        make(partial(write, "done"), interrupt)
    assert not make(interrupt, partial(write, "rest")).missing
    with pytest.raises(USER_ERRORS, match="holds results of another configuration"):
        make(partial(write, "theirs"), description="other settings")
