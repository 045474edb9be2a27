"""Libraries to compare with, each set in a virtual environment of its own.

`<name>.txt` beside this module pins a set; scripts beside it run there and exchange files with the
benchmark, so that no peer is a dependency of the project or meets its versions.
"""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

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
    print(f"installing peers {name}", file=sys.stderr)
    pip = [sys.executable, "-m", "pip", "--python", str(python), "--disable-pip-version-check"]
    for command in (
        [sys.executable, "-m", "venv", "--clear", "--without-pip", str(folder)],
        [*pip, "install", "-r", str(requirements)],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            lines = (done.stdout + done.stderr).splitlines() or ["no output"]
            errors = [line for line in lines if line.startswith("ERROR")]
            raise PeerError(
                f"peers {name} must install from {name}.txt, but {(errors or lines)[-1]}; correct"
                " that file, or make the package index reachable"
            )
