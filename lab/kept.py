"""What the documents keep of the results: one table and one figure of each study, in docs/results.

`python -m lab keep` writes them from lab/results, with their provenance, and `python -m lab check`
compares the tables that are kept with those that are there.
"""

import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer
from PIL import Image

from lab import RESULTS
from lab.experiments.running.provenance import FILE_NAME
from lab.thesis import PAGE, filled
from serd_bag.files import atomic_write_bytes, read_bytes, read_text
from serd_cli.errors import FAILED
from serd_files.yaml_config import read_yaml, write_yaml

#: Where the documents show them; below the root, as `RESULTS`.
DOCUMENTS = Path("docs/results")


@dataclass(frozen=True)
class Kept:
    """A study by the name of its folder of results; figure: empty where none is kept."""

    name: str
    table: str
    figure: str = ""


KEPT = (
    Kept("minimum-example", "log_likelihood.csv", "estimates.png"),
    Kept("priors", "optimal_distributions.csv"),
    Kept("policy-cost", "exponents.csv"),
    Kept("gridworld", "summary.csv", "measures.png"),
    Kept("gridworld-pm", "summary.csv"),
    Kept("gridworld-aerial", "summary.csv"),
    Kept("ascents", "costs.csv", "gaps.png"),
    Kept("rust", "estimates.csv"),
    Kept("hallway", "figure_5_9.csv", "figure_5_9.png"),
    Kept("robots", "summary.csv", "robots.png"),
    Kept("people", "summary.csv", "people.png"),
    Kept("durations", "summary.csv"),
    Kept("standard-errors", "summary.csv"),
    Kept("bench", "bench.csv", "bench.png"),
    Kept("broken-bags", "saved.csv"),
)


def keep() -> None:
    """Write tables and figures of docs/results from lab/results, and the numbers of their page."""
    file = DOCUMENTS / FILE_NAME
    noted: dict[str, Any] = _mapping(file) if file.exists() else {}
    for kept in KEPT:
        for name in filter(None, (kept.table, kept.figure)):
            source = RESULTS / kept.name / name
            if source.exists():
                target = DOCUMENTS / f"{kept.name}{source.suffix}"
                content = small_picture(source) if name == kept.figure else read_bytes(source)
                atomic_write_bytes(target, content)
                print(target)
        runs = RESULTS / kept.name / FILE_NAME
        if runs.exists():
            noted[kept.name] = [
                {key: run.get(key) for key in ("command", "began", "commit", "packages")}
                for run in _mapping(runs)["runs"]
            ]
    atomic_write_bytes(file, write_yaml(noted).encode())
    atomic_write_bytes(PAGE, filled(read_text(PAGE), DOCUMENTS).encode())


def check() -> None:
    """Compare the tables that the documents keep with lab/results.

    Exit code 1 where one differs.
    """
    states = dict(compared())
    for name, state in states.items():
        print(f"{state:10}  {name}")
    if "differs" in states.values():
        raise typer.Exit(FAILED)


def compared() -> Iterator[tuple[str, str]]:
    """For each kept table its file, and "equal", "differs" or "no results"."""
    for kept in KEPT:
        source, target = RESULTS / kept.name / kept.table, DOCUMENTS / f"{kept.name}.csv"
        if not source.exists():
            yield str(target), "no results"
            continue
        equal = target.exists() and read_bytes(source) == read_bytes(target)
        yield str(target), "equal" if equal else "differs"


def small_picture(path: Path) -> bytes:
    """A PNG with 256 colours, a third as large as with all of them."""
    file = io.BytesIO()
    with Image.open(path) as picture:
        few = picture.convert("RGB").quantize(256, dither=Image.Dither.NONE)
        few.save(file, "PNG", optimize=True)
    return file.getvalue()


def _mapping(path: Path) -> dict[str, Any]:
    content = read_yaml(read_text(path), str(path))
    return content if isinstance(content, dict) else {}
