"""Processes that live and end together."""

import os
import select
import signal
import subprocess
import sys
from contextlib import contextmanager

import pytest

from serd_cli.errors import BAD_INPUT, FAILED, RunError
from serd_cli.processes import supervisor
from serd_cli.processes.supervisor import Process, run_together
from serd_ros.process.progress import Progress
from support.waiting import PATIENCE_S, children_of

SLEEP = [sys.executable, "-S", "-c", "import time; time.sleep(3600)"]


def python(name, code):
    return Process(name, [sys.executable, "-S", "-c", code])


def test_when_one_ends_well_all_end_and_every_line_was_passed_on():
    lines, speaker = [], python("speaker", "print('it\\'s done')")
    take = lambda *line: lines.append(line)  # noqa: E731
    run_together([Process("sleeper", SLEEP), speaker], os.environ, take)
    assert ("speaker", "it's done") in lines


PROGRESS = "serd-progress " + Progress(text="step", done=1).model_dump_json()


@pytest.mark.parametrize(
    ("end", "sentence", "passed_on"),
    [
        ("sys.exit(3)", "bad ended with exit code 3", FAILED),
        ("sys.exit(2)", "bad ended with exit code 2", BAD_INPUT),
        (f"[print('{PROGRESS}') for _ in range(40)]; sys.exit(1)", "exit code 1", FAILED),
        ("sys.stdout.flush(); os.kill(os.getpid(), 9)", "bad was killed by signal 9", FAILED),
    ],
)
def test_a_failing_process_is_named_with_its_last_output(end, sentence, passed_on):
    failing = python("bad", f"import os, sys; print('the reason'); {end}")
    with pytest.raises(RunError, match=rf"(?s){sentence}.*the reason") as found:
        run_together([Process("sleeper", SLEEP), failing], os.environ, lambda *_: None)
    assert found.value.exit_code == passed_on
    assert "serd-progress" not in str(found.value)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_an_interrupt_and_a_closed_window_end_all_and_give_the_handler_back(number):
    before = signal.getsignal(number)
    talker = python("talker", "import time; print('ready', flush=True); time.sleep(3600)")
    interrupt = lambda *_: os.kill(os.getpid(), number)  # noqa: E731
    with pytest.raises(KeyboardInterrupt):
        run_together([Process("sleeper", SLEEP), talker], os.environ, interrupt)
    assert signal.getsignal(number) is before


def test_an_interrupt_before_all_have_started_ends_all_too(monkeypatch):
    start = supervisor.Manager._start

    def start_late(manager):
        os.kill(os.getpid(), signal.SIGINT)
        start(manager)

    monkeypatch.setattr(supervisor.Manager, "_start", start_late)
    codes, loop = [], supervisor.Manager.loop

    def loop_and_report(manager):
        loop(manager)
        codes.append(manager.exit_codes())

    monkeypatch.setattr(supervisor.Manager, "loop", loop_and_report)
    processes = [Process(f"sleeper {number}", SLEEP) for number in range(3)]
    with pytest.raises(KeyboardInterrupt):
        run_together(processes, os.environ, lambda *_: None)
    assert codes == [dict.fromkeys((each.name for each in processes), -signal.SIGTERM)]


ENDING = """
import signal, sys, time
signal.signal(signal.SIGTERM, lambda *_: (print("ended well", file=open(sys.argv[1], "w")), exit()))
print("ready", flush=True)
while True: time.sleep(3600)
"""
STUBBORN = """
import signal, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
print("ready", flush=True)
while True: time.sleep(3600)
"""
COMMAND = """
import os, sys
from serd_cli.processes import supervisor
supervisor._GRACE_S = float(sys.argv[1])
node = supervisor.Process("node", [sys.executable, "-S", "-c", *sys.argv[2:]])
supervisor.run_together([node], os.environ, lambda _, line: print(line, flush=True))
"""


@contextmanager
def command_that_runs(*node, grace_s=0.5):
    """A command in a session of its own, its node, which is ready, and a descriptor of that."""
    words, pipe = [sys.executable, "-c", COMMAND, str(grace_s), *node], subprocess.PIPE
    with subprocess.Popen(words, stdout=pipe, text=True, start_new_session=True) as command:
        assert command.stdout.readline() == "ready\n"
        (keeper,) = children_of(command.pid)
        (pid,) = children_of(keeper)
        descriptor = os.pidfd_open(pid)
        try:
            yield command, pid, descriptor
        finally:
            command.kill()
            os.close(descriptor)


def has_ended(descriptor, limit_s=PATIENCE_S):
    return bool(select.select([descriptor], [], [], limit_s)[0])


@pytest.mark.parametrize("end", [os.kill, os.killpg])
def test_after_sigkill_of_the_command_or_its_group_a_node_ends_by_its_handler(tmp_path, end):
    given = ENDING, str(tmp_path / "end")
    with command_that_runs(*given, grace_s=PATIENCE_S) as (command, _, node):
        end(command.pid, signal.SIGKILL)
        assert has_ended(node)
    assert (tmp_path / "end").read_text() == "ended well\n"


@pytest.mark.parametrize("stopped", [False, True])
@pytest.mark.parametrize("killed", ["command", "keeper"])
def test_after_sigkill_of_the_command_or_its_keeper_a_node_that_does_not_end_is_killed(
    killed, stopped
):
    with command_that_runs(STUBBORN) as (command, pid, node):
        assert not has_ended(node, 0.0)
        if stopped:
            os.kill(pid, signal.SIGSTOP)
        (keeper,) = children_of(command.pid)
        os.kill(command.pid if killed == "command" else keeper, signal.SIGKILL)
        assert has_ended(node)
