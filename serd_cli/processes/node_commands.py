"""The command lines of nodes: from their names, by the ament index, as `ros2 run` finds them.

Installed by pip alone there is no workspace that holds the executables of our own nodes; then they
are run by this Python, which is the same.
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
from serd_cli.processes.workspace import PREFIXES, paths_in
from serd_files.moved_names import where_or_near
from serd_files.yaml_config import read_yaml
from serd_ros.graph.graph import PACKAGE, Stack, load_graph, placed_nodes

_MARKERS = "share/ament_index/resource_index/packages"


def find_command(package: str, executable: str, environment: Mapping[str, str]) -> list[str]:
    """The words that start lib/<package>/<executable> of the first prefix that has the package.

    Raises UsageError with the nearest right name.
    """
    prefixes = map(Path, paths_in(environment, PREFIXES))
    prefix = next((each for each in prefixes if (each / _MARKERS / package).exists()), None)
    if prefix is None and package == PACKAGE:
        _require_known(package, executable, sorted(load_graph().nodes))
        return [sys.executable, "-m", f"{PACKAGE}.process.executable", executable]
    if prefix is None:
        known = all_executables(environment)
        raise UsageError(f"package {package!r} is not installed; {hint(package, known)}")
    _require_known(package, executable, executables_of(prefix, package))
    return [str(prefix / "lib" / package / executable)]


def all_executables(environment: Mapping[str, str]) -> dict[str, list[str]]:
    """Executables by package, of the packages that have any; our own nodes among them."""
    found = {PACKAGE: sorted(load_graph().nodes)}
    for prefix in map(Path, reversed(paths_in(environment, PREFIXES))):
        for marker in (prefix / _MARKERS).glob("*"):
            if executables := executables_of(prefix, marker.name):
                found[marker.name] = executables
    return dict(sorted(found.items()))


def _require_known(package: str, executable: str, known: list[str]) -> None:
    if executable not in known:
        near = where_or_near("executable", executable, known)
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
