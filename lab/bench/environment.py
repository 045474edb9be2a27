"""Libraries to compare with, each set in a virtual environment of its own.

Methods run there and exchange files with the table, so that no library is a dependency of the
project or meets its versions.
"""

import fcntl
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ENVIRONMENTS = Path(__file__).parents[2] / ".cache" / "peers"
#: Written last, so an environment whose installation was interrupted is made again.
STAMP = "installed.txt"


class PeerError(RuntimeError):
    """A library cannot be installed."""


def peer_python(name: str, requirements: Sequence[str]) -> Path:
    """Interpreter of the environment of a name; installs the requirements where that is due.

    An environment is kept as long as its requirements and the Python version stay the same; who
    asks while another installs it waits. PeerError where pip fails.
    """
    folder = ENVIRONMENTS / name
    python, stamp = folder / "bin" / "python", folder / STAMP
    contents = "\n".join([f"# Python {sys.version}", *requirements])
    ENVIRONMENTS.mkdir(parents=True, exist_ok=True)
    with (ENVIRONMENTS / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (stamp.is_file() and stamp.read_text() == contents):
            _install(name, requirements, folder, python)
            stamp.write_text(contents)
    return python


def environment_apart() -> dict[str, str]:
    """The variables of this process without the path to the project's packages."""
    return {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}


def _install(name: str, requirements: Sequence[str], folder: Path, python: Path) -> None:
    print(f"installing {', '.join(requirements)}", file=sys.stderr)
    pip = [sys.executable, "-m", "pip", "--python", str(python), "--disable-pip-version-check"]
    for command in (
        [sys.executable, "-m", "venv", "--clear", "--without-pip", str(folder)],
        [*pip, "install", *requirements],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            lines = (done.stdout + done.stderr).splitlines() or ["no output"]
            errors = [line for line in lines if line.startswith("ERROR")]
            raise PeerError(
                f"{name} must install ({', '.join(requirements)}), but {(errors or lines)[-1]};"
                " make the package index reachable"
            )
