"""A node detects whether the process that started it has ended."""

import os
import signal
import subprocess
import sys

import pytest

from serd_ros.errors import NodeError
from serd_ros.process.parent_watch import VARIABLE, ParentProcess
from support.waiting import PATIENCE_S


def test_without_the_variable_no_parent_has_ended():
    assert not ParentProcess({}).has_ended


def test_a_parent_has_ended_once_it_was_killed():
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(3600)"])
    parent = ParentProcess({VARIABLE: str(process.pid)})
    assert not parent.has_ended
    process.kill()
    process.wait()
    assert parent.has_ended
    parent.close()


def test_a_parent_that_ended_before_is_rejected():
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    with pytest.raises(NodeError, match=r"names process .*, which has ended; unset it"):
        ParentProcess({VARIABLE: str(process.pid)})


def test_a_parent_that_is_no_process_id_is_rejected():
    with pytest.raises(NodeError, match="must be a process id, got 'me'; unset it"):
        ParentProcess({VARIABLE: "me"})


_BUSY = """
import sys, time
from serd_ros.process.parent_watch import ParentProcess
ParentProcess().end_process_with_parent()
print("watching", flush=True)
while True:
    time.sleep(3600)
"""


def test_a_process_ends_with_its_parent_while_it_does_something_else(root):
    parent = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(3600)"])
    environment = {**os.environ, VARIABLE: str(parent.pid), "PYTHONPATH": str(root)}
    with subprocess.Popen(
        [sys.executable, "-c", _BUSY], env=environment, stdout=subprocess.PIPE, text=True
    ) as busy:
        assert busy.stdout.readline() == "watching\n"
        assert busy.poll() is None
        parent.kill()
        parent.wait()
        assert busy.wait(PATIENCE_S) == -signal.SIGALRM


def test_this_process_has_not_ended():
    parent = ParentProcess({VARIABLE: str(os.getpid())})
    assert not parent.has_ended
    parent.close()
