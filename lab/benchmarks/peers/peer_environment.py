"""Libraries to compare with, each set in a virtual environment of its own.

Scripts run there and exchange files with the benchmark, so that no peer is a dependency of the
project or meets its versions.
"""

import fcntl
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

PEERS = Path(__file__).parent
ENVIRONMENTS = Path(__file__).parents[3] / ".cache" / "peers"
#: Written last, so an environment whose installation was interrupted is made again.
STAMP = "installed.txt"


class PeerError(RuntimeError):
    """A peer cannot be installed or run."""


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


def run_peer(name: str, requirements: Sequence[str], script: str, *arguments: str | Path) -> None:
    """Run `peers/<script>` in the environment of a name; its output goes to the terminal.

    PeerError where it fails. The project is not importable there, and what the peer leaves in its
    working folder is thrown away, so paths are best absolute.
    """
    command = [str(peer_python(name, requirements)), str(PEERS / script), *map(str, arguments)]
    with TemporaryDirectory() as folder:
        ended = subprocess.run(command, env=environment_apart(), cwd=folder, check=False)
    if ended.returncode != 0:
        raise PeerError(f"{script} must end with 0, got {ended.returncode}; see its messages above")


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
