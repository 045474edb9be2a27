"""A node knows whether the command that started it still lives."""

import os
import subprocess
import sys

import pytest

from serd_ros.errors import NodeError
from serd_ros.process.parent_watch import VARIABLE, Starter


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


def test_this_process_is_not_gone():
    starter = Starter({VARIABLE: str(os.getpid())})
    assert not starter.gone
    starter.close()
