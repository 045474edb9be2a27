"""Where ROS packages are: what sourcing ros_ws/install would put into the environment.

A sourced workspace comes first, then ros_ws/install of this project, then the environment the ROS
wheels are installed in. colcon describes what each package adds in `share/<package>/hook/*.dsv`
(one `prepend-non-duplicate;VARIABLE;path` a line), which is read here in place of its shell twin.
"""

import os
import sys
from collections.abc import Mapping
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]
LOOPBACK_PROFILE = PROJECT / "serd_ros" / "process" / "fastdds_loopback.xml"
PREFIXES = "AMENT_PREFIX_PATH"
_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_PROFILE = "FASTRTPS_DEFAULT_PROFILES_FILE"


def ros_environment(base: Mapping[str, str]) -> dict[str, str]:
    """`base` with the packages of the workspace and of the wheels, and loopback-only DDS.

    The workspace is $SERD_WORKSPACE, else the project's own ros_ws. The profile allows UDP on
    loopback only: as fast as shared memory here, and a killed process leaves no segment behind. The
    discovery range must be SYSTEM_DEFAULT for it, since LOCALHOST makes rmw_fastrtps add shared
    memory again. Where `base` sets either, both are left alone.
    """
    environment = dict(base)
    install = Path(os.environ.get("SERD_WORKSPACE") or PROJECT / "ros_ws") / "install"
    for hook in sorted(install.glob("*/share/*/hook/*.dsv")):
        for line in hook.read_text(encoding="utf-8").splitlines():
            kind, _, rest = line.partition(";")
            variable, _, path = rest.partition(";")
            if kind == "prepend-non-duplicate":
                _add(environment, variable, str(hook.parents[3] / path))
    if (Path(sys.prefix) / "share/ament_index").is_dir():
        _add(environment, PREFIXES, sys.prefix, last=True)
    if not {_RANGE, _PROFILE} & environment.keys():
        environment |= {_RANGE: "SYSTEM_DEFAULT", _PROFILE: str(LOOPBACK_PROFILE)}
    environment.setdefault("PYTHONUNBUFFERED", "1")
    return environment


def _add(environment: dict[str, str], variable: str, path: str, *, last: bool = False) -> None:
    paths = paths_in(environment, variable)
    if path not in paths:
        environment[variable] = os.pathsep.join([*paths, path] if last else [path, *paths])


def paths_in(environment: Mapping[str, str], variable: str) -> list[str]:
    """The paths that a variable lists."""
    return [path for path in environment.get(variable, "").split(os.pathsep) if path]
