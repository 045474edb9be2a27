"""Commands that tests run in their own process."""

import io
import json
import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from serd_cli.main import main
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
        """The sentence in one line by which it refused its input; it must have ended with 2."""
        assert self.code == 2, self.err
        return " ".join(self.err.split())


def run_serd(*words: str | Path) -> int:
    """The exit code of `serd` with some words."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["serd", *map(str, words)])
        try:
            return main()
        except SystemExit as ended:
            return int(ended.code or 0)


def printed_in(folder: Path, *words: str | Path) -> str:
    """What `serd` prints with some words in a folder; it must end well."""
    printed = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(printed):
        patch.chdir(folder)
        assert run_serd(*words) == 0
    return printed.getvalue()


def work_in_empty_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Commands of the test run in an empty folder and print lines of 160 characters."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "160")
    # A console that was made before keeps the width of its terminal.
    for console in (terminal.console, terminal.progress_console):
        monkeypatch.setattr(console, "_width", 160)
