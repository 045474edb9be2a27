from functools import partial

import pytest

from lab.experiments.minimum_example.explanations import MinimumExampleConfig, fit_sets
from lab.experiments.running.repetitions import run_repetitions
from serd_core.errors import SerdError
from serd_files.errors import USER_ERRORS
from serd_sim.episodes.execution import Execution


def square(number):
    return [{"number": number, "square": number**2}]


def quiet(done, total):
    assert done <= total


def test_rows_come_in_the_order_of_repetitions(tmp_path):
    rows = run_repetitions(square, 5, tmp_path, "squares", Execution(n_jobs=1), quiet)
    assert rows == [{"number": n, "square": n * n} for n in range(5)]


def test_several_processes_give_the_same_rows(tmp_path):
    config = MinimumExampleConfig(n_sets=8, sizes=(3,))
    work = partial(fit_sets, config, 2)
    parallel = run_repetitions(work, 4, tmp_path / "two", "sets", Execution(n_jobs=2), quiet)
    serial = run_repetitions(work, 4, tmp_path / "one", "sets", Execution(n_jobs=1), quiet)
    assert parallel == serial


def test_finished_repetitions_are_not_run_again(tmp_path):
    run_repetitions(square, 3, tmp_path, "squares", Execution(n_jobs=1), quiet)
    ran = []

    def remembered(number):
        ran.append(number)
        return square(number)

    rows = run_repetitions(remembered, 5, tmp_path, "squares", Execution(n_jobs=1), quiet)
    assert ran == [3, 4]
    assert len(rows) == 5


def test_what_was_done_before_a_failure_is_kept(tmp_path):
    def fails_at_two(number):
        if number == 2:
            raise RuntimeError("no more")
        return square(number)

    with pytest.raises(RuntimeError, match="no more"):
        run_repetitions(fails_at_two, 4, tmp_path, "squares", Execution(n_jobs=1), quiet)
    assert len(list(tmp_path.glob("repetition_*.json"))) == 2


def test_a_folder_with_results_of_other_settings_is_refused(tmp_path):
    run_repetitions(square, 1, tmp_path, "squares", Execution(n_jobs=1), quiet)
    with pytest.raises(USER_ERRORS, match="holds results of another configuration"):
        run_repetitions(square, 1, tmp_path, "cubes", Execution(n_jobs=1), quiet)


@pytest.mark.parametrize("damaged", [b"", b'[{"number": 0', b"\xff\xfe\x01", b"null", b"[" * 10**6])
def test_a_damaged_result_is_named_with_what_to_do(tmp_path, damaged):
    run_repetitions(square, 2, tmp_path, "squares", Execution(n_jobs=1), quiet)
    (tmp_path / "repetition_00001.json").write_bytes(damaged)
    with pytest.raises(USER_ERRORS, match=r"repetition_00001.json must hold .* delete it and run"):
        run_repetitions(square, 2, tmp_path, "squares", Execution(n_jobs=1), quiet)
    (tmp_path / "repetition_00001.json").unlink()
    assert len(run_repetitions(square, 2, tmp_path, "squares", Execution(n_jobs=1), quiet)) == 2


def test_a_changed_result_is_named_and_one_of_an_earlier_version_is_read(tmp_path):
    def run():
        return run_repetitions(square, 2, tmp_path, "squares", Execution(n_jobs=1), quiet)

    run()
    file = tmp_path / "repetition_00001.json"
    whole = file.read_text()
    file.write_text(whole.replace('"square": 1', '"square": 7'))
    with pytest.raises(USER_ERRORS, match=r"repetition_00001.json must hold .* but is damaged"):
        run()
    file.write_text(whole.partition("\n")[0])
    assert run()[1] == {"number": 1, "square": 1}


def test_a_damaged_note_of_the_configuration_is_one_of_other_settings(tmp_path):
    run_repetitions(square, 1, tmp_path, "squares", Execution(n_jobs=1), quiet)
    (tmp_path / "configuration.txt").write_bytes(b"\xff\xfe")
    with pytest.raises(USER_ERRORS, match="holds results of another configuration"):
        run_repetitions(square, 1, tmp_path, "squares", Execution(n_jobs=1), quiet)


def test_a_run_that_failed_at_once_leaves_the_folder_to_other_settings(tmp_path):
    def fails(number):
        raise SerdError(f"image must be a file, in repetition {number}")

    with pytest.raises(USER_ERRORS, match="image must be a file"):
        run_repetitions(fails, 1, tmp_path, "misspelt", Execution(n_jobs=1), quiet)
    rows = run_repetitions(square, 2, tmp_path, "right", Execution(n_jobs=1), quiet)
    assert len(rows) == 2
    assert (tmp_path / "configuration.txt").read_text() == "right"
