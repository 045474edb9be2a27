"""What the documents keep of the results: one table and one figure of each study, in docs/results.

`python -m lab keep` writes them from lab/results, with their provenance, and `python -m lab check`
compares the tables that are kept with those that are there. `python -m lab archive` packs all
results into one file.
"""

import io
import lzma
import platform
import shlex
import tarfile
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from PIL import Image

from lab import RESULTS
from lab.experiments.running.provenance import FILE_NAME, code_commit, installed_versions
from serd_bag.files import atomic_write_bytes, read_bytes, read_text
from serd_files.yaml_config import read_yaml, write_yaml

#: Where the documents show them; below the root, as `RESULTS`.
DOCUMENTS = Path("docs/results")
_COLOURS = 256
_PACKAGES = ("serd", "serd-lab", "numpy", "scipy", "pandas", "matplotlib")


@dataclass(frozen=True)
class Kept:
    """A study by the name of its folder or file of results; without a file that is empty."""

    name: str
    table: str = ""
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
    Kept("detour", "summary.csv", "detour.png"),
    Kept("people", "summary.csv", "people.png"),
    Kept("durations", "summary.csv"),
    Kept("speed", figure="speed.png"),
)


def keep(results: Path = RESULTS, documents: Path = DOCUMENTS) -> list[Path]:
    """Write tables, figures and their provenance from the results that are there; the files."""
    file = documents / FILE_NAME
    noted: dict[str, Any] = _mapping(file) if file.exists() else {}
    written = []
    for kept in KEPT:
        for name in filter(None, (kept.table, kept.figure)):
            source = _source(results, kept, name)
            if source.exists():
                target = documents / f"{kept.name}{source.suffix}"
                atomic_write_bytes(
                    target, small_picture(source) if name == kept.figure else read_bytes(source)
                )
                written.append(target)
        runs = results / kept.name / FILE_NAME
        if runs.exists():
            noted[kept.name] = [
                {key: run.get(key) for key in ("command", "began", "commit", "packages")}
                for run in _mapping(runs)["runs"]
            ]
    atomic_write_bytes(file, write_yaml(noted).encode())
    return written


def compared(results: Path = RESULTS, documents: Path = DOCUMENTS) -> Iterator[tuple[str, str]]:
    """For each kept table its file, and "equal", "differs" or "no results"."""
    for kept in KEPT:
        if kept.table:
            source, target = _source(results, kept, kept.table), documents / f"{kept.name}.csv"
            if not source.exists():
                yield str(target), "no results"
                continue
            equal = target.exists() and read_bytes(source) == read_bytes(target)
            yield str(target), "equal" if equal else "differs"


def small_picture(path: Path) -> bytes:
    """A PNG with 256 colours, a third as large as with all of them."""
    file = io.BytesIO()
    with Image.open(path) as picture:
        few = picture.convert("RGB").quantize(_COLOURS, dither=Image.Dither.NONE)
        few.save(file, "PNG", optimize=True)
    return file.getvalue()


def archive(output: Path, results: Path = RESULTS) -> int:
    """Pack all results into a tar.xz file, with provenance.yaml; the number of files.

    Its paths begin with `results`: `tar -C lab -xf FILE` unpacks it where it was.
    """
    files = [path for path in sorted(results.rglob("*")) if path.is_file()]
    packed = {
        "command": shlex.join(["python", "-m", "lab", "archive", output.name]),
        "made": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "commit": code_commit(),
        "python": platform.python_version(),
        "packages": installed_versions(_PACKAGES),
        "files": len(files),
    }
    memory = io.BytesIO()
    with tarfile.open(fileobj=memory, mode="w") as tar:
        _add(tar, FILE_NAME, write_yaml(packed).encode())
        for path in files:
            _add(tar, path.relative_to(results).as_posix(), read_bytes(path))
    atomic_write_bytes(output, lzma.compress(memory.getvalue(), preset=9))
    return len(files)


def _add(tar: tarfile.TarFile, name: str, content: bytes) -> None:
    """Add a file without owner and time, so that equal results are packed equally."""
    member = tarfile.TarInfo(f"results/{name}")
    member.size = len(content)
    tar.addfile(member, io.BytesIO(content))


def _source(results: Path, kept: Kept, name: str) -> Path:
    """Benchmarks have no folders of their own."""
    return results / name if not kept.table else results / kept.name / name


def _mapping(path: Path) -> dict[str, Any]:
    content = read_yaml(read_text(path), str(path))
    return content if isinstance(content, dict) else {}
