"""Processes that live and end together."""

import os
import signal
import sys
import threading
import time

import pytest

from serd_cli.errors import RunError
from serd_cli.supervisor import Process, run_together

SLEEP = [sys.executable, "-S", "-c", "import time; time.sleep(60)"]


def python(name, code):
    return Process(name, [sys.executable, "-S", "-c", code])


def test_when_one_ends_well_all_end_and_every_line_was_passed_on():
    lines = []
    began_s = time.monotonic()
    run_together(
        [Process("sleeper", SLEEP), python("speaker", "print('it\\'s done')")],
        os.environ,
        lambda name, line: lines.append((name, line)),
    )
    assert ("speaker", "it's done") in lines
    assert time.monotonic() - began_s < 20


def test_a_failing_process_is_named_with_what_it_said_last():
    failing = python("bad", "import sys; print('the reason'); sys.exit(3)")
    with pytest.raises(RunError, match=r"(?s)bad ended with exit code 3.*the reason"):
        run_together([Process("sleeper", SLEEP), failing], os.environ, lambda *_: None)


def test_a_killed_process_is_named_with_its_signal():
    killed = python("victim", "import os; os.kill(os.getpid(), 9)")
    with pytest.raises(RunError, match="victim was killed by signal 9"):
        run_together([killed, Process("sleeper", SLEEP)], os.environ, lambda *_: None)


@pytest.mark.parametrize("delay_s", [0.0, 0.5])
def test_an_interrupt_ends_all_even_before_all_have_started(delay_s):
    before = signal.getsignal(signal.SIGINT)
    timer = threading.Timer(delay_s, lambda: os.kill(os.getpid(), signal.SIGINT))
    processes = [Process(f"sleeper {number}", SLEEP) for number in range(3)]

    def run_and_be_interrupted():
        try:
            timer.start()
            run_together(processes, os.environ, lambda *_: None)
        finally:
            timer.join()

    with pytest.raises(KeyboardInterrupt):
        run_and_be_interrupted()
    assert signal.getsignal(signal.SIGINT) is before
