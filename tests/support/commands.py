"""Commands that tests run in their own process."""

import json
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from serd_cli.output import terminal


class Ended(NamedTuple):
    """How a command ended and what it printed."""

    code: int
    out: str
    err: str

    @property
    def values(self) -> Any:
        """The result that it printed as JSON; it must have ended well."""
        assert self.code == 0, self.err
        return json.loads(self.out)

    @property
    def refusal(self) -> str:
        """The sentence by which it refused its input; it must have ended with 2."""
        assert self.code == 2, self.err
        return self.err


def work_in_empty_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Commands of the test run in an empty folder and print lines of 160 characters."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "160")
    # A console that was made before keeps the width of its terminal.
    for console in (terminal.console, terminal.progress_console):
        monkeypatch.setattr(console, "_width", 160)
