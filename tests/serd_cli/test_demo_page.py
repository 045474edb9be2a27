"""The page beside a demo: its address, a port that is in use, and none at all."""

import os
import socket
import sys
from types import SimpleNamespace

import pytest

from serd_cli.demo import live_page
from serd_cli.processes.stack_run import port_fault
from serd_ros.graph.configs import WatchPageConfig
from serd_ros.process.progress import Progress
from support.waiting import wait_until

ADDRESS = "http://127.0.0.1:8766/"


@pytest.fixture
def node(monkeypatch):
    """Sets what the process that stands for the node of the page runs."""

    def use(code):
        command = [sys.executable, "-S", "-c", code]
        monkeypatch.setattr(live_page, "node_command", lambda *_: command)

    return use


@pytest.fixture
def opened(monkeypatch):
    """Addresses that were opened in a browser."""
    found = []
    monkeypatch.setattr(live_page.webbrowser, "open", found.append)
    return found


def printed_of_a_demo(monkeypatch, folder):
    """What is printed until the first line of the page's node has been taken."""
    found = []
    console = SimpleNamespace(print=lambda text, **_: found.append(str(text)))
    monkeypatch.setattr(live_page, "progress_console", console)
    with live_page.live_page("hallway", os.environ, folder):
        wait_until(lambda: found)
    return found


@pytest.mark.parametrize(("display", "terminal_there"), [("", True), (":0", False), (":0", True)])
def test_the_address_is_printed_and_opened_where_there_is_a_display_and_a_terminal(
    node, opened, monkeypatch, tmp_path, display, terminal_there
):
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    output = SimpleNamespace(isatty=lambda: terminal_there)
    monkeypatch.setattr(live_page.sys, "stdout", output)
    report = "serd-progress " + Progress(text="page", address=ADDRESS).model_dump_json()
    node(f"import sys, time; print({report!r}, file=sys.stderr, flush=True); time.sleep(3600)")
    assert printed_of_a_demo(monkeypatch, tmp_path) == [f"watch the drives at {ADDRESS}"]
    assert opened == ([ADDRESS] if display and terminal_there else [])


def test_where_no_page_can_be_served_a_sentence_names_the_reason(
    node, opened, monkeypatch, tmp_path
):
    node("import sys; sys.exit('watch_page: cannot serve on 127.0.0.1')")
    (sentence,) = printed_of_a_demo(monkeypatch, tmp_path)
    assert sentence == "no page shows the drives: watch_page: cannot serve on 127.0.0.1"
    assert not opened
    assert "cannot serve" in (tmp_path / "watch_page.log").read_text()


@pytest.mark.parametrize("fault", ["", "Address already in use"])
def test_a_port_that_is_in_use_is_replaced_by_a_free_one(monkeypatch, tmp_path, fault):
    used = []

    def command(_, parameters, *__):
        used.append(parameters["port"])
        return [sys.executable, "-S", "-c", "raise SystemExit('over')"]

    monkeypatch.setattr(live_page, "node_command", command)
    monkeypatch.setattr(live_page, "port_fault", lambda *_: fault)
    printed_of_a_demo(monkeypatch, tmp_path)
    assert used == [0 if fault else WatchPageConfig().port]


def test_the_fault_of_a_port_is_named_while_another_program_has_it():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert "in use" in port_fault("127.0.0.1", port)
    assert port_fault("127.0.0.1", port) == ""
