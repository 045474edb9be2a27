"""Ctrl-C during imports ends a command with 130, without a word."""

import os
import signal
import subprocess
import sys

import pytest

from serd_ros.process.executable import starting
from support.waiting import PATIENCE_S

#: Takes the place of a library, so that its import is under way for long. A signal just before one
#: long sleep would be handled after it.
_SLOW = "import time\nprint('importing', flush=True)\nwhile True:\n    time.sleep(0.01)\n"


@pytest.mark.parametrize(
    ("library", "words"),
    [
        ("typer", ["serd_cli.main", "--help"]),
        ("rclpy", ["serd_ros.process.executable", "hallway_sim"]),
    ],
)
def test_ctrl_c_during_an_import_ends_quietly(root, tmp_path, library, words):
    (tmp_path / f"{library}.py").write_text(_SLOW)
    path = f"{tmp_path}{os.pathsep}{os.getenv('PYTHONPATH', root)}"
    words, pipe = [sys.executable, "-m", *words], subprocess.PIPE
    environment = {**os.environ, "PYTHONPATH": path}
    with subprocess.Popen(words, env=environment, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdout.readline() == "importing\n"
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert errors == ""


def test_afterwards_ctrl_c_is_what_it_was_before():
    before = signal.getsignal(signal.SIGINT)
    with starting():
        assert signal.getsignal(signal.SIGINT) is not before
    assert signal.getsignal(signal.SIGINT) is before
