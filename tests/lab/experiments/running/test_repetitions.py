import pytest

from lab.experiments.running.repetitions import run_repetitions
from serd_files.errors import USER_ERRORS
from serd_sim.episodes.execution import Execution


def square(number):
    return [{"number": number, "square": number**2}]


def quiet(done, total):
    assert done <= total


def test_rows_come_in_the_order_of_repetitions(tmp_path):
    rows = run_repetitions(square, 5, tmp_path, "squares", Execution(n_jobs=1), quiet)
    assert rows == [{"number": n, "square": n * n} for n in range(5)]


def test_finished_repetitions_are_not_run_again(tmp_path):
    run_repetitions(square, 3, tmp_path, "squares", Execution(n_jobs=1), quiet)
    ran = []

    def remembered(number):
        ran.append(number)
        return square(number)

    rows = run_repetitions(remembered, 5, tmp_path, "squares", Execution(n_jobs=1), quiet)
    assert ran == [3, 4]
    assert len(rows) == 5


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
