"""A node knows whether the command that started it still lives."""

import os
import subprocess
import sys

import pytest

from serd_ros.errors import NodeError
from serd_ros.process.parent_watch import VARIABLE, Starter
from support.waiting import PATIENCE_S


def test_a_node_without_a_starter_never_misses_one():
    assert not Starter({}).gone


def test_a_starter_is_gone_once_it_was_killed():
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(3600)"])
    starter = Starter({VARIABLE: str(process.pid)})
    assert not starter.gone
    process.kill()
    process.wait()
    assert starter.gone
    starter.close()


def test_a_starter_that_ended_before_is_refused():
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    with pytest.raises(NodeError, match=r"names process .*, which has ended; unset it"):
        Starter({VARIABLE: str(process.pid)})


def test_a_starter_that_is_no_process_id_is_refused():
    with pytest.raises(NodeError, match="must be a process id, got 'me'; unset it"):
        Starter({VARIABLE: "me"})


_BUSY = """
import sys, time
from serd_ros.process.parent_watch import Starter
Starter().end_process_when_gone()
print("watching", flush=True)
while True:
    time.sleep(3600)
"""


def test_a_process_ends_with_its_starter_while_it_does_something_else(root):
    starter = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(3600)"])
    environment = {**os.environ, VARIABLE: str(starter.pid), "PYTHONPATH": str(root)}
    with subprocess.Popen(
        [sys.executable, "-c", _BUSY], env=environment, stdout=subprocess.PIPE, text=True
    ) as busy:
        assert busy.stdout.readline() == "watching\n"
        assert busy.poll() is None
        starter.kill()
        starter.wait()
        assert busy.wait(PATIENCE_S) == 2


def test_this_process_is_not_gone():
    starter = Starter({VARIABLE: str(os.getpid())})
    assert not starter.gone
    starter.close()
