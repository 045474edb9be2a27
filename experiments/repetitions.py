"""Repetitions of an experiment: in parallel, with progress, resumable.

Each repetition is a function of its number alone (seeds are derived from it) and returns rows of a
table. Its rows are written to a file of their own as soon as it is done, so an interrupted run goes
on where it stopped. A folder belongs to one configuration; another one is refused.
"""

import csv
import io
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import joblib

from experiments.cluster import connect
from experiments.provenance import FILE_NAME
from serd_core.errors import SerdError
from storage.atomic import atomic_write_text

#: One line of a result table; None where a number does not apply.
Row = dict[str, Any]
Progress = Callable[[int, int], None]
BACKENDS = ("loky", "threading", "multiprocessing", "dask", "ray")


@dataclass(frozen=True)
class Execution:
    """Where repetitions run.

    n_jobs: processes at a time, -1 for all cores; backend: one of BACKENDS. A cluster is the one
    connected to already, else the one that DASK_SCHEDULER_ADDRESS or RAY_ADDRESS names.
    """

    n_jobs: int = -1
    backend: str = "loky"

    def __post_init__(self) -> None:
        if self.n_jobs == 0:
            raise SerdError("jobs must not be 0; use 1 for one process or -1 for all cores")
        if self.backend not in BACKENDS:
            raise SerdError(f"backend must be among {list(BACKENDS)}, got {self.backend!r}")

    def activate(self) -> AbstractContextManager[Any]:
        """Context in which joblib uses the backend."""
        if self.n_jobs == 1:
            return nullcontext()
        connect(self.backend)
        settings: Any = joblib.parallel_config(backend=self.backend, n_jobs=self.n_jobs)
        return settings  # type: ignore[no-any-return]


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
    progress: told (done, all) at the start and after each repetition.
    """
    claim_folder(folder, description)
    files = [folder / f"repetition_{number:05d}.json" for number in range(n_repetitions)]
    missing = [number for number, file in enumerate(files) if not file.exists()]
    done = n_repetitions - len(missing)
    progress(done, n_repetitions)
    with execution.activate():
        for number, rows in _results(repetition, missing, execution):
            atomic_write_text(files[number], json.dumps(rows))
            done += 1
            progress(done, n_repetitions)
    return [row for file in files for row in json.loads(file.read_text())]


def claim_folder(folder: Path, description: str) -> None:
    """Make the folder and note its configuration; SerdError where it holds results of another.

    A run that failed before its first result, over a misspelt setting say, leaves no claim.
    """
    folder.mkdir(parents=True, exist_ok=True)
    note = folder / "configuration.txt"
    noted = note.read_text() if note.exists() else None
    results = {path.name for path in folder.iterdir()} - {note.name, FILE_NAME}
    if noted not in (None, description) and results:
        raise SerdError(
            f"folder {folder} holds results of another configuration ({note.name} says which)"
            "; choose another folder or delete it"
        )
    if noted != description:
        atomic_write_text(note, description)


def write_table(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as CSV; columns in the order of the first row."""
    if not rows:
        raise SerdError(f"rows for {path} must not be empty; run at least one repetition")
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    atomic_write_text(path, text.getvalue())


def _results(
    repetition: Callable[[int], list[Row]], numbers: Sequence[int], execution: Execution
) -> Iterator[tuple[int, list[Row]]]:
    if execution.n_jobs == 1:
        yield from ((number, repetition(number)) for number in numbers)
        return
    parallel = joblib.Parallel(return_as="generator_unordered")
    yield from parallel(joblib.delayed(_numbered)(repetition, number) for number in numbers)


def _numbered(repetition: Callable[[int], list[Row]], number: int) -> tuple[int, list[Row]]:
    return number, repetition(number)
