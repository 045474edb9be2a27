"""Runs methods on cases: one process per task and method, one line of results per case.

Lines are appended to `TASK.METHOD.jsonl` as they are measured, and those that are there are not
measured again.
"""

import ast
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from lab.bench import methods, worker
from lab.bench.environment import environment_apart, peer_python
from lab.bench.tasks import TASKS
from lab.experiments.running.tables import Row

_FILES = Path(methods.__file__).parent
_MARK = "BENCH "


@dataclass(frozen=True)
class Method:
    """A method by the name of its file."""

    name: str

    @property
    def file(self) -> Path:
        """Where its `learn` is."""
        return _FILES / f"{self.name}.py"

    @cached_property
    def _stated(self) -> dict[str, Any]:
        """Its constants, read without importing it: its libraries are not here."""
        found: dict[str, Any] = {}
        for line in ast.parse(self.file.read_text()).body:
            if isinstance(line, ast.Assign):
                names, value = ast.unparse(line.targets[0]).strip("()").split(", "), line.value
                try:
                    content = ast.literal_eval(value)
                except ValueError:
                    continue
                found |= zip(names, content, strict=True) if len(names) > 1 else {names[0]: content}
        return found

    @property
    def title(self) -> str:
        """Its name in the table."""
        return str(self._stated["TITLE"])

    @property
    def requirements(self) -> tuple[str, ...]:
        """Of its own environment; none where it is the project's."""
        return tuple(self._stated["REQUIREMENTS"])

    @property
    def most_seeds(self) -> int | None:
        """How many seeds it is measured with at most."""
        return self._stated.get("SEEDS")

    def command(self) -> tuple[list[str], dict[str, str]]:
        """Interpreter and variables of its process; installs its environment where that is due.

        PeerError where that fails.
        """
        if self.requirements:
            return [str(peer_python(self.name, self.requirements))], environment_apart()
        root = str(_FILES.parents[2])
        path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
        return [sys.executable], os.environ | {"PYTHONPATH": path}


#: By name: SERD, IRL under its prior, the project's other methods, other libraries.
METHODS = {
    each.name: each
    for each in sorted(
        (Method(path.stem) for path in _FILES.glob("[!_]*.py")),
        key=lambda method: (
            bool(method.requirements),
            method.name != "serd",
            method.name != "irl_same_prior",
            method.name,
        ),
    )
}


@dataclass(frozen=True)
class Batch:
    """The cases of one task and one method. data: folder of recordings, results: of lines."""

    task: str
    method: Method
    n_seeds: int
    data: Path
    results: Path

    @property
    def file(self) -> Path:
        """Where the lines are."""
        return self.results / f"{self.task}.{self.method.name}.jsonl"

    def rows(self) -> list[Row]:
        """What has been measured."""
        if not self.file.exists():
            return []
        return [json.loads(line) for line in self.file.read_text().splitlines()]

    def missing(self) -> list[tuple[int, int]]:
        """(size, seed) of the cases that have not been measured."""
        done = {(row["size"], row["seed"]) for row in self.rows()}
        limits = self.n_seeds, self.method.most_seeds, TASKS[self.task].most_seeds
        n_seeds = min(limit for limit in limits if limit is not None)
        cases = [(size, seed) for size in TASKS[self.task].sizes for seed in range(n_seeds)]
        return [case for case in cases if case not in done]

    def run(self, on_row: Callable[[], None]) -> None:
        """Measure what is missing; SerdError without the data, PeerError without the library."""
        cases = {case: TASKS[self.task].case(self.data, *case) for case in self.missing()}
        if not cases:
            return
        self.results.mkdir(parents=True, exist_ok=True)
        interpreter, variables = self.method.command()
        with TemporaryDirectory() as name:
            folder = Path(name)
            for number, case in enumerate(cases.values()):
                np.savez(folder / f"case_{number}.npz", **case.given())
            command = [*interpreter, str(Path(worker.__file__)), str(self.method.file), name]
            keys = list(cases)
            for line in _lines(command, variables, name):
                number = line.pop("case")
                row = dict(zip(("size", "seed"), keys[number], strict=True)) | line
                result = folder / f"result_{number}.npz"
                if result.exists():
                    with np.load(result) as content:
                        row |= cases[keys[number]].scores(dict(content))
                with self.file.open("a") as file:
                    file.write(json.dumps(row) + "\n")
                on_row()


def _lines(command: list[str], variables: dict[str, str], folder: str) -> Iterator[dict[str, Any]]:
    """What the worker reports; the rest of its output is that of libraries."""
    with subprocess.Popen(
        command, env=variables, cwd=folder, stdout=subprocess.PIPE, text=True,
        stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        try:
            assert process.stdout is not None
            for line in process.stdout:
                if line.startswith(_MARK):
                    yield json.loads(line.removeprefix(_MARK))
        finally:
            process.kill()
