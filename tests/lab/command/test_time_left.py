import pytest
from rich.progress import Task

from lab.command.progress import TimeLeftColumn, time_left_s


def test_before_anything_is_done_the_costs_are_shared_by_all_processes():
    assert time_left_s(0.0, 600.0, 50.0, n_processes=4) == 150.0


def test_the_rest_goes_on_as_fast_as_what_is_done():
    # 100 s of work took 300 s: the machine is busy.
    assert time_left_s(100.0, 400.0, 300.0, n_processes=2) == pytest.approx(900.0)
    assert time_left_s(400.0, 400.0, 300.0, n_processes=2) == 0.0


def test_the_estimate_counts_down_until_the_next_piece_ends():
    now_s = [0.0]
    task = Task(0, "", total=400.0, completed=0.0, _get_time=lambda: now_s[0])
    task.start_time = 0.0
    column = TimeLeftColumn(n_processes=2)

    def shown_at(time_s, completed):
        now_s[0], task.completed = time_s, completed
        return column.render(task).plain

    assert shown_at(0.0, 0.0) == "left 0:03:20"
    assert shown_at(60.0, 0.0) == "left 0:02:20"
    assert shown_at(100.0, 100.0) == "left 0:05:00"
    assert shown_at(220.0, 100.0) == "left 0:03:00"
    assert shown_at(1000.0, 100.0) == "left 0:00:00"
