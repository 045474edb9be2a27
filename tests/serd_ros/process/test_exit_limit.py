"""Native code that keeps the interpreter ends with its time limit."""

import subprocess
import sys

import pytest

from serd_ros.process.exit_limit import process_ends_within

#: Native code that waits for a signal and keeps Python's lock, as the middleware does.
HANGS = "import ctypes; ctypes.PyDLL(None).pause()"
PROGRAM = """
from serd_ros.process.exit_limit import process_ends_within
with process_ends_within({code}, 50):
    {inside}
{after}
"""


def exit_code_of(**parts):
    return subprocess.run([sys.executable, "-c", PROGRAM.format(**parts)], check=False).returncode


@pytest.mark.parametrize("code", [0, 2])
def test_a_process_whose_native_code_never_returns_ends_with_the_code(code):
    assert exit_code_of(code=code, inside=HANGS, after="raise SystemExit(9)") == code


def test_what_returns_in_time_goes_on():
    assert exit_code_of(code=2, inside="pass", after="import time; time.sleep(0.2)") == 0


def test_an_error_inside_is_raised():
    with pytest.raises(ValueError, match="inside"), process_ends_within(1, 60_000):
        raise ValueError("inside")
