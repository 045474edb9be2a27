"""Processes that live and end together."""

import os
import signal
import sys

import pytest

from serd_cli import supervisor
from serd_cli.errors import BAD_INPUT, FAILED, RunError
from serd_cli.supervisor import Process, run_together

SLEEP = [sys.executable, "-S", "-c", "import time; time.sleep(3600)"]


def python(name, code):
    return Process(name, [sys.executable, "-S", "-c", code])


def test_when_one_ends_well_all_end_and_every_line_was_passed_on():
    lines = []
    run_together(
        [Process("sleeper", SLEEP), python("speaker", "print('it\\'s done')")],
        os.environ,
        lambda name, line: lines.append((name, line)),
    )
    assert ("speaker", "it's done") in lines


@pytest.mark.parametrize(("code", "passed_on"), [(3, FAILED), (2, BAD_INPUT)])
def test_a_failing_process_is_named_with_what_it_said_last(code, passed_on):
    failing = python("bad", f"import sys; print('the reason'); sys.exit({code})")
    with pytest.raises(
        RunError, match=rf"(?s)bad ended with exit code {code}.*the reason"
    ) as found:
        run_together([Process("sleeper", SLEEP), failing], os.environ, lambda *_: None)
    assert found.value.exit_code == passed_on


def test_a_killed_process_is_named_with_its_signal():
    killed = python("victim", "import os; os.kill(os.getpid(), 9)")
    with pytest.raises(RunError, match="victim was killed by signal 9"):
        run_together([killed, Process("sleeper", SLEEP)], os.environ, lambda *_: None)


def interrupt_myself():
    os.kill(os.getpid(), signal.SIGINT)


def test_an_interrupt_ends_all_and_gives_the_handler_back():
    before = signal.getsignal(signal.SIGINT)
    talker = python("talker", "import time; print('ready', flush=True); time.sleep(3600)")
    with pytest.raises(KeyboardInterrupt):
        run_together([Process("sleeper", SLEEP), talker], os.environ, lambda *_: interrupt_myself())
    assert signal.getsignal(signal.SIGINT) is before


def test_a_window_that_is_closed_ends_all_too():
    before = signal.getsignal(signal.SIGHUP)
    talker = python("talker", "import time; print('ready', flush=True); time.sleep(3600)")
    with pytest.raises(KeyboardInterrupt):
        run_together(
            [Process("sleeper", SLEEP), talker],
            os.environ,
            lambda *_: os.kill(os.getpid(), signal.SIGHUP),
        )
    assert signal.getsignal(signal.SIGHUP) is before


def test_an_interrupt_before_all_have_started_ends_all_too(monkeypatch):
    start = supervisor.Manager._start

    def start_late(manager):
        interrupt_myself()
        start(manager)

    monkeypatch.setattr(supervisor.Manager, "_start", start_late)
    processes = [Process(f"sleeper {number}", SLEEP) for number in range(3)]
    with pytest.raises(KeyboardInterrupt):
        run_together(processes, os.environ, lambda *_: None)
