"""From package and executable names to a command, by the ament index, as `ros2 run` finds it.

Installed by pip alone there is no workspace that holds the executables of our own nodes; then they
are run by this Python, which is the same.
"""

import os
import sys
from collections.abc import Mapping
from pathlib import Path

from serd_cli.errors import UsageError
from serd_ros.graph.graph import COMPOSED, PACKAGE, load_graph
from storage.nearest import hint

_MARKERS = "share/ament_index/resource_index/packages"


def find_command(package: str, executable: str, environment: Mapping[str, str]) -> list[str]:
    """The words that start lib/<package>/<executable> of the first prefix that has the package.

    Raises UsageError with the nearest right name.
    """
    prefixes = _prefixes(environment)
    prefix = next((each for each in prefixes if (each / _MARKERS / package).exists()), None)
    if prefix is None and package == PACKAGE:
        _require_known(package, executable, _own())
        return [sys.executable, "-m", f"{PACKAGE}.process.executable", executable]
    if prefix is None:
        known = all_executables(environment)
        raise UsageError(f"package {package!r} is not installed; {hint(package, known)}")
    _require_known(package, executable, executables_of(prefix, package))
    return [str(prefix / "lib" / package / executable)]


def shared_file(package: str, name: str, environment: Mapping[str, str]) -> Path | None:
    """share/<package>/<name> of the first prefix that has it."""
    files = (each / "share" / package / name for each in _prefixes(environment))
    return next((file for file in files if file.is_file()), None)


def all_executables(environment: Mapping[str, str]) -> dict[str, list[str]]:
    """Executables by package, of the packages that have any; our own nodes among them."""
    found = {PACKAGE: _own()}
    for prefix in reversed(_prefixes(environment)):
        for marker in (prefix / _MARKERS).glob("*"):
            if executables := executables_of(prefix, marker.name):
                found[marker.name] = executables
    return dict(sorted(found.items()))


def _own() -> list[str]:
    """The executables of this project."""
    return sorted([*load_graph().nodes, COMPOSED])


def _require_known(package: str, executable: str, known: list[str]) -> None:
    if executable not in known:
        raise UsageError(
            f"package {package!r} has no executable {executable!r}; {hint(executable, known)}"
        )


def executables_of(prefix: Path, package: str) -> list[str]:
    """Names of the executables a package installs."""
    folder = prefix / "lib" / package
    files = folder.iterdir() if folder.is_dir() else iter(())
    return sorted(path.name for path in files if path.is_file() and os.access(path, os.X_OK))


def _prefixes(environment: Mapping[str, str]) -> list[Path]:
    text = environment.get("AMENT_PREFIX_PATH", "")
    return [Path(part) for part in text.split(os.pathsep) if part]
