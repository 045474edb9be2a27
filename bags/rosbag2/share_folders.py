"""Where installed ROS packages keep their message definitions.

A sourced ROS installation says so in AMENT_PREFIX_PATH; the wheels from PyPI put the same `share`
folder into the prefix of the Python environment, and nothing needs to be sourced.
"""

import os
import sys
from pathlib import Path


def share_folders() -> tuple[Path, ...]:
    """Existing `share` folders, the sourced installation first."""
    prefixes = [part for part in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if part]
    folders = (Path(prefix) / "share" for prefix in (*prefixes, sys.prefix))
    return tuple(folder for folder in dict.fromkeys(folders) if folder.is_dir())


def interface_file(package: str, name: str, suffix: str) -> Path | None:
    """The file `share/<package>/msg/<name><suffix>` of the first installation that has it."""
    candidates = (folder / package / "msg" / f"{name}{suffix}" for folder in share_folders())
    return next((path for path in candidates if path.is_file()), None)
