"""`python -m lab archive`, `keep` and `check`: what becomes of results."""

from pathlib import Path
from typing import Annotated

import typer

from lab import RESULTS, thesis
from lab.experiments.study.hallway.tables.page import PAGE, filled
from lab.experiments.study.products import SETTINGS_YAML
from lab.kept import DOCUMENTS, compared
from lab.kept import archive as pack
from lab.kept import keep as keep_results
from serd_bag.files import atomic_write_text, read_text, require_file_place
from serd_cli.errors import FAILED, UsageError

_HALLWAY = RESULTS / "hallway"


def archive(
    output: Annotated[Path, typer.Argument(help="file to write, .tar.xz", metavar="OUT.tar.xz")],
) -> None:
    """Pack everything in lab/results into one file, with commit, versions and command.

    python -m lab archive results.tar.xz

    `tar -C lab -xf results.tar.xz` unpacks it where it was.
    """
    if not output.name.endswith(".tar.xz"):
        raise UsageError(f"the archive must be named *.tar.xz, got {output}")
    require_file_place(output)
    if not RESULTS.is_dir():
        raise UsageError(f"{RESULTS} must hold results to pack; run a study first")
    n_files = pack(output)
    print(f"{n_files} files: {output.resolve()}")


def keep() -> None:
    """Write the tables and figures of docs/results, and the tables of pages, from lab/results.

    What has no results stays as it is.
    """
    for path in keep_results():
        print(path)
    if (_HALLWAY / SETTINGS_YAML).exists():
        atomic_write_text(PAGE, filled(read_text(PAGE), _HALLWAY))
        print(PAGE)
    atomic_write_text(thesis.PAGE, thesis.filled(read_text(thesis.PAGE), DOCUMENTS))
    print(thesis.PAGE)


def check() -> None:
    """Compare the tables that the documents keep with lab/results.

    Exit code 1 where one differs.
    """
    found = list(compared())
    if (_HALLWAY / SETTINGS_YAML).exists():
        page = read_text(PAGE)
        found.append((str(PAGE), _state(equal=filled(page, _HALLWAY) == page)))
    page = read_text(thesis.PAGE)
    found.append((str(thesis.PAGE), _state(equal=thesis.filled(page, DOCUMENTS) == page)))
    for name, state in found:
        print(f"{state:10}  {name}")
    if any(state == "differs" for _, state in found):
        raise typer.Exit(FAILED)


def _state(*, equal: bool) -> str:
    return "equal" if equal else "differs"
