"""Repetitions of an experiment: in parallel, with progress, resumable.

Each repetition is a function of its number alone (seeds are derived from it) and returns rows of a
table. Its rows are written to a file of their own as soon as it is done, so an interrupted run is
resumed where it stopped. A folder belongs to one configuration; another one is rejected.
"""

import json
from collections.abc import Callable, Mapping
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from lab.experiments.running.provenance import FILE_NAME
from lab.experiments.running.tables import Row
from serd_bag.files import atomic_write_text, read_bytes
from serd_core.errors import SerdError
from serd_sim.episodes.execution import Execution

Progress = Callable[[int, int], None]
Content = TypeVar("Content", dict[str, Any], list[Any])


def run_repetitions(
    repetition: Callable[[int], list[Row]],
    n_repetitions: int,
    folder: Path,
    description: str,
    execution: Execution,
    progress: Progress,
) -> list[Row]:
    """All rows, in the order of repetitions; finished ones are read instead of run.

    description: text of the configuration, equal exactly for equal ones.
    progress: called with (done, all) at the start and after each repetition.
    """
    claim_folder(folder, description)
    files = [folder / f"repetition_{number:05d}.json" for number in range(n_repetitions)]
    missing = [number for number, file in enumerate(files) if not file.exists()]
    done = n_repetitions - len(missing)
    progress(done, n_repetitions)
    with closing(execution.results(partial(_numbered, repetition), missing)) as results:
        for number, rows in results:
            write_result(files[number], rows)
            done += 1
            progress(done, n_repetitions)
    return [row for file in files for row in read_result(file, list)]


def read_result(file: Path, kind: type[Content]) -> Content:
    """What a task wrote as JSON; SerdError where the file has been damaged since."""
    try:
        # Files of earlier versions have a second line.
        content = json.loads(read_bytes(file).decode().partition("\n")[0])
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, kind):
        raise SerdError(
            f"{file} must hold what a finished part of the run wrote, but is damaged"
            "; delete it and run the command again, which makes it anew"
        )
    return content


def write_result(file: Path, content: Mapping[str, Any] | list[Any]) -> None:
    """Write what a task found as JSON."""
    atomic_write_text(file, json.dumps(content))


def claim_folder(folder: Path, description: str) -> None:
    """Make the folder and note its configuration; SerdError where it holds results of another.

    A run that fails before its first result, as with a misspelt setting, leaves no claim.
    """
    folder.mkdir(parents=True, exist_ok=True)
    note = folder / "configuration.txt"
    noted = read_bytes(note) if note.exists() else None
    results = {path.name for path in folder.iterdir()} - {note.name, FILE_NAME}
    if noted not in (None, description.encode()) and results:
        raise SerdError(
            f"folder {folder} holds results of another configuration ({note.name} names it)"
            "; choose another folder or delete it"
        )
    if noted != description.encode():
        atomic_write_text(note, description)


def _numbered(repetition: Callable[[int], list[Row]], number: int) -> tuple[int, list[Row]]:
    return number, repetition(number)
