from collections.abc import Callable
from pathlib import Path

import pytest

from lab.__main__ import main
from support.commands import Ended, work_in_empty_folder


@pytest.fixture
def lab(monkeypatch, capsys, tmp_path) -> Callable[..., Ended]:
    """Runs `python -m lab` with some words in an empty folder."""
    work_in_empty_folder(monkeypatch, tmp_path)

    def run(*words: str | Path) -> Ended:
        return Ended(main([*map(str, words)]), *capsys.readouterr())

    return run
