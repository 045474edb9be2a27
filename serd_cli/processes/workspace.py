"""Where ROS packages are: what sourcing ros_ws/install would put into the environment.

A sourced workspace comes first, then ros_ws/install of this project, then the environment the ROS
wheels are installed in. colcon describes what each package adds in `share/<package>/hook/*.dsv`
(one `prepend-non-duplicate;VARIABLE;path` a line), which is read here in place of its shell twin.
"""

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from serd_bag.errors import shortened
from serd_bag.nearest import hint
from serd_cli.errors import UsageError
from serd_cli.processes.supervisor import Process
from serd_files.yaml_config import read_yaml
from serd_ros.graph.graph import (
    LOOPBACK_PROFILE,
    PACKAGE,
    PROFILE_VARIABLE,
    Stack,
    load_graph,
    placed_nodes,
)

PROJECT = Path(__file__).resolve().parents[2]
PREFIXES = "AMENT_PREFIX_PATH"
_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"


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
    if not {_RANGE, PROFILE_VARIABLE} & environment.keys():
        environment |= {_RANGE: "SYSTEM_DEFAULT", PROFILE_VARIABLE: str(LOOPBACK_PROFILE)}
    environment.setdefault("PYTHONUNBUFFERED", "1")
    return environment


def _add(environment: dict[str, str], variable: str, path: str, *, last: bool = False) -> None:
    paths = paths_in(environment, variable)
    if path not in paths:
        environment[variable] = os.pathsep.join([*paths, path] if last else [path, *paths])


def paths_in(environment: Mapping[str, str], variable: str) -> list[str]:
    """The paths that a variable lists."""
    return [path for path in environment.get(variable, "").split(os.pathsep) if path]


_MARKERS = "share/ament_index/resource_index/packages"


def find_command(package: str, executable: str, environment: Mapping[str, str]) -> list[str]:
    """The words that start lib/<package>/<executable> of the first prefix that has the package.

    Raises UsageError with the nearest right name.
    """
    prefixes = [*map(Path, paths_in(environment, PREFIXES))]
    prefix = next((each for each in prefixes if (each / _MARKERS / package).exists()), None)
    if prefix is None and package == PACKAGE:
        _require_known(package, executable, sorted(load_graph().nodes))
        return [sys.executable, "-m", f"{PACKAGE}.process.executable", executable]
    if prefix is None:
        installed = {marker.name for each in prefixes for marker in (each / _MARKERS).glob("*")}
        near = hint(package, installed | {PACKAGE})
        raise UsageError(f"package {package!r} is not installed; {near}")
    _require_known(package, executable, executables_of(prefix, package))
    return [str(prefix / "lib" / package / executable)]


def _require_known(package: str, executable: str, known: list[str]) -> None:
    if executable not in known:
        near = hint(executable, known)
        raise UsageError(f"package {package!r} has no executable {executable!r}; {near}")


def executables_of(prefix: Path, package: str) -> list[str]:
    """Names of the executables a package installs."""
    folder = prefix / "lib" / package
    files = folder.iterdir() if folder.is_dir() else iter(())
    return sorted(path.name for path in files if path.is_file() and os.access(path, os.X_OK))


def parse_assignment(text: str) -> tuple[str, Any]:
    """`name:=value` as a name and a YAML value that a ROS parameter can have."""
    name, separator, written = text.partition(":=")
    if not separator or not name:
        raise UsageError(f"a parameter must be written name:=value, got {shortened(repr(text))}")
    value = read_yaml(written, f"parameter {shortened(repr(name))}")
    if not all(map(_is_ros_value, value if isinstance(value, list) else [value])):
        raise UsageError(
            f"parameter {shortened(repr(name))} must be true or false, a 64-bit number, printable"
            f" text or a list of these, got {shortened(repr(written))}; put text into quotes"
        )
    return name, value


def stack_processes(
    stack: Stack, given: Mapping[str, Any], environment: Mapping[str, str], namespace: str = ""
) -> list[Process]:
    """The processes of a stack, with their parameters; namespace: in full."""
    found = []
    for placed in placed_nodes(stack, given, namespace):
        own = {"__ns": placed.namespace} if placed.namespace else {}
        topics = {**placed.remappings, **own}
        command = node_command(placed.node, placed.parameters, topics, environment)
        found.append(Process(placed.node, command))
    return found


def node_command(
    node: str,
    parameters: Mapping[str, Any],
    remappings: Mapping[str, str],
    environment: Mapping[str, str],
) -> list[str]:
    """Executable and arguments of one node of ours."""
    names = [word for name, topic in remappings.items() for word in ("-r", f"{name}:={topic}")]
    for name, value in parameters.items():
        names += ["-p", f"{name}:={_as_ros(value)}"]
    return [*find_command(PACKAGE, node, environment), "--ros-args", *names]


def _is_ros_value(value: Any) -> bool:
    if isinstance(value, int):
        return -(2**63) <= value < 2**63
    return isinstance(value, float) or (isinstance(value, str) and value.isprintable())


def _as_ros(value: Any) -> str:
    """A value as rcl's YAML reads it; a string in quotes, or an empty one would get lost."""
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_as_ros(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return "'" + value.replace("'", "''") + "'"
    return repr(value)
