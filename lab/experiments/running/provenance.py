"""Provenance of results: `provenance.yaml` beside them lists every run that wrote into a folder.

A run that resumes an interrupted one is added to the list, so it stays visible when repetitions of
one table were computed by different commits.
"""

import platform
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from serd_bag.files import atomic_write_text, read_text
from serd_core.errors import SerdError
from serd_files.yaml_config import read_yaml, write_yaml

FILE_NAME = "provenance.yaml"
PACKAGES = ("serd", "numpy", "scipy")


@contextmanager
def recorded(
    folder: Path, command: str, settings: object, clock: Callable[[], float] = time.perf_counter
) -> Iterator[None]:
    """Record the run inside in `folder` when it ends or is interrupted; errors are not recorded.

    That is its command, settings in full, time, code, and whether it finished; the commit is None
    where the code is installed without a repository.

    SerdError where another study or experiment wrote into the folder: tables share names.
    """
    _require_same_work(folder, command)
    began, start_s, commit = datetime.now(timezone.utc), clock(), code_commit()

    def note(*, finished: bool) -> None:
        run = {
            "command": command,
            "settings": repr(settings),
            "began": began.isoformat(timespec="seconds"),
            "seconds": round(clock() - start_s, 1),
            "finished": finished,
            "commit": commit,
            "python": platform.python_version(),
            "packages": installed_versions(PACKAGES),
        }
        file = folder / FILE_NAME
        atomic_write_text(file, write_yaml({"runs": [*_runs(file), run]}))

    try:
        yield
    except KeyboardInterrupt:
        note(finished=False)
        raise
    note(finished=True)


def code_commit(folder: Path = Path(__file__).parent) -> str | None:
    """Commit of the repository around `folder`, "+ changes" where tracked files differ from it."""
    commit = _git(folder, "rev-parse", "HEAD")
    if commit is None:
        return None
    return f"{commit} + changes" if _git(folder, "status", "-uno", "--porcelain") else commit


def installed_versions(names: Sequence[str]) -> dict[str, str]:
    """Version of each package that is installed."""
    found = {}
    for name in names:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _runs(path: Path) -> list[dict[str, Any]]:
    content = read_yaml(read_text(path), str(path)) if path.exists() else {"runs": []}
    runs = content.get("runs") if isinstance(content, dict) else None
    if not isinstance(runs, list) or not all(
        isinstance(run, dict) and isinstance(run.get("command"), str) for run in runs
    ):
        raise SerdError(
            f"{path} must list the runs that wrote into its folder, but is damaged; move it away"
        )
    return runs


def _require_same_work(folder: Path, command: str) -> None:
    """SerdError where another study or experiment wrote into the folder.

    A work is named by the word after `python -m lab`, or the third word of `serd study hallway`.
    """
    for run in _runs(folder / FILE_NAME):
        if _work_of(run["command"]) != _work_of(command):
            raise SerdError(
                f"folder {folder} holds results of '{run['command']}', which"
                f" 'python -m lab {_work_of(command)}' would overwrite; choose another folder"
            )


def _work_of(command: str) -> str:
    words = command.split()
    return " ".join(words[3:4] if words[:3] == ["python", "-m", "lab"] else words[2:3])


def _git(folder: Path, *words: str) -> str | None:
    """Output of git, or None where there is no git or no repository."""
    try:
        found = subprocess.run(
            ["git", "-C", str(folder), *words], capture_output=True, text=True, check=False
        )
    except OSError:
        return None
    return found.stdout.strip() if found.returncode == 0 else None
