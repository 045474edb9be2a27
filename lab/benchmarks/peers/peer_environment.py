"""Libraries to compare with, each set in a virtual environment of its own.

`<name>.txt` beside this module pins a set; scripts beside it run there and exchange files with the
benchmark, so that no peer is a dependency of the project or meets its versions.
"""

import os
import subprocess
import sys
from collections import deque
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console

PEERS = Path(__file__).parent
ENVIRONMENTS = Path(__file__).parents[3] / ".cache" / "peers"
#: Written last, so an environment whose installation was interrupted is made again.
STAMP = "installed.txt"


class PeerError(RuntimeError):
    """A peer cannot be installed or run."""


def peer_python(name: str) -> Path:
    """Interpreter of the environment for `peers/<name>.txt`; installs it where that is due.

    An environment is kept as long as its requirements and the Python version stay the same.
    PeerError where there is no such file, or where pip fails.
    """
    requirements = PEERS / f"{name}.txt"
    if not requirements.is_file():
        known = ", ".join(sorted(path.stem for path in PEERS.glob("*.txt")))
        raise PeerError(f"name must be a set of peers ({known}), got {name!r}; add {requirements}")
    folder = ENVIRONMENTS / name
    python, stamp = folder / "bin" / "python", folder / STAMP
    contents = f"# Python {sys.version}\n{requirements.read_text()}"
    if not (stamp.is_file() and stamp.read_text() == contents):
        _install(name, requirements, folder, python)
        stamp.write_text(contents)
    return python


def run_peer(name: str, script: str, *arguments: str | Path) -> None:
    """Run `peers/<script>` in the environment `name`; its output goes to the terminal.

    PeerError where it fails. The project is not importable there, and what the peer leaves in its
    working folder is thrown away, so paths are best absolute.
    """
    command = [str(peer_python(name)), str(PEERS / script), *map(str, arguments)]
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    with TemporaryDirectory() as folder:
        code = subprocess.run(command, env=environment, cwd=folder, check=False).returncode
    if code != 0:
        raise PeerError(f"{script} must end with 0, got {code}; see its messages above")


def _install(name: str, requirements: Path, folder: Path, python: Path) -> None:
    _follow(name, [sys.executable, "-m", "venv", "--clear", "--without-pip", str(folder)])
    pip = [sys.executable, "-m", "pip", "--python", str(python), "--disable-pip-version-check"]
    _follow(name, [*pip, "install", "-r", str(requirements)])


def _follow(name: str, command: list[str]) -> None:
    """Run a command with its latest line shown; PeerError with its last words where it fails."""
    with (
        Console(stderr=True).status(f"installing peers {name}") as status,
        subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        ) as process,
    ):
        assert process.stdout is not None
        last = deque[str](maxlen=20)
        for line in process.stdout:
            last.append(line.strip())
            status.update(f"installing peers {name}: {line.strip()[:80]}")
    if process.returncode != 0:
        raise PeerError(
            f"peers {name} must install from {name}.txt, but {_reason(last)}; correct that file,"
            " or make the package index reachable"
        )


def _reason(lines: Iterable[str]) -> str:
    """The last line that pip marks as an error, or the last one."""
    kept = list(lines)
    errors = [line for line in kept if line.startswith("ERROR")]
    return (errors or kept or ["no output"])[-1]
