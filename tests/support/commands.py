"""Commands that tests run in their own process."""

from pathlib import Path
from typing import NamedTuple

import pytest

from serd_cli.output import terminal


class Ended(NamedTuple):
    """How a command ended and what it printed."""

    code: int
    out: str
    err: str


def work_in_empty_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Commands of the test run in an empty folder and print lines of 160 characters."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "160")
    # A console that was made before keeps the width of its terminal.
    for console in (terminal.console, terminal.progress_console):
        monkeypatch.setattr(console, "_width", 160)
