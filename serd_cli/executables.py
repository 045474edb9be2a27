"""From package and executable names to a path, by the ament index, as `ros2 run` finds it."""

import os
from collections.abc import Mapping
from pathlib import Path

from serd_cli.errors import UsageError
from storage.nearest import hint

_MARKERS = "share/ament_index/resource_index/packages"


def find_executable(package: str, executable: str, environment: Mapping[str, str]) -> Path:
    """lib/<package>/<executable> of the first prefix that has the package.

    Raises UsageError with the nearest right name.
    """
    prefixes = _prefixes(environment)
    prefix = next((each for each in prefixes if (each / _MARKERS / package).exists()), None)
    if prefix is None:
        raise UsageError(f"package {package!r} is not installed; {hint(package, _all(prefixes))}")
    path = prefix / "lib" / package / executable
    if not (path.is_file() and os.access(path, os.X_OK)):
        raise UsageError(
            f"package {package!r} has no executable {executable!r}; "
            f"{hint(executable, executables_of(prefix, package))}"
        )
    return path


def executables_of(prefix: Path, package: str) -> list[str]:
    """Names of the executables a package installs."""
    folder = prefix / "lib" / package
    files = folder.iterdir() if folder.is_dir() else iter(())
    return sorted(path.name for path in files if path.is_file() and os.access(path, os.X_OK))


def _all(prefixes: list[Path]) -> list[str]:
    """Packages that install at least one executable."""
    names = {
        marker.name: prefix
        for prefix in prefixes
        for marker in (prefix / _MARKERS).glob("*")
        if executables_of(prefix, marker.name)
    }
    return sorted(names)


def _prefixes(environment: Mapping[str, str]) -> list[Path]:
    text = environment.get("AMENT_PREFIX_PATH", "")
    return [Path(part) for part in text.split(os.pathsep) if part]
