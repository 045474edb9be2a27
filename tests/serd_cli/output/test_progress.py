"""Progress that can be followed in a file."""

import pytest

from serd_cli.output import terminal
from serd_cli.output.terminal import WorkProgress


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now[0])
    return now


def test_without_a_terminal_a_line_comes_every_half_minute(clock, capsys):
    bar = WorkProgress("{task.description} {task.completed} of {task.total}")
    with bar:
        task = bar.add_task("episodes", total=9)
        for done in range(1, 7):
            clock[0] += 11.0
            bar.update(task, completed=done)
        lines = capsys.readouterr().err.split("\n")
    assert [line.strip() for line in lines if line.strip()] == [
        "episodes 3 of 9",
        "episodes 6 of 9",
    ]


def test_on_a_terminal_the_bar_is_drawn_in_place(clock, monkeypatch, capsys):
    monkeypatch.setattr(terminal.progress_console, "_force_terminal", True)
    bar = WorkProgress("{task.completed} done")
    task = bar.add_task("episodes", total=2)
    clock[0] += 60.0
    bar.update(task, completed=1)
    assert capsys.readouterr().err == ""
