"""The page beside a demo: when its address is printed and opened, and a port that is in use."""

import socket
from types import SimpleNamespace

import pytest

from serd_cli.demo import phases
from serd_cli.demo.phases import LivePage
from serd_cli.processes.stack_run import port_fault

ADDRESS = "http://127.0.0.1:8766/"


@pytest.mark.parametrize(("display", "is_terminal"), [("", True), (":0", False), (":0", True)])
def test_an_address_is_printed_once_and_opened_where_there_is_a_display_and_a_terminal(
    monkeypatch, display, is_terminal
):
    printed, opened = [], []
    console = SimpleNamespace(print=lambda text: printed.append(str(text)))
    monkeypatch.setattr(phases, "progress_console", console)
    monkeypatch.setattr(phases.webbrowser, "open", opened.append)
    monkeypatch.setattr(phases.sys, "stdout", SimpleNamespace(isatty=lambda: is_terminal))
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    page = LivePage()
    for _ in range(2):
        page.show(ADDRESS)
    assert printed == [f"watch the drives at {ADDRESS}"]
    assert opened == ([ADDRESS] if display and is_terminal else [])


@pytest.mark.parametrize(("fault", "port"), [("", 8766), ("Address already in use", 0)])
def test_a_port_that_is_in_use_is_replaced_by_a_free_one(monkeypatch, fault, port):
    monkeypatch.setattr(phases, "port_fault", lambda *_: fault)
    assert LivePage().parameters() == {"watch_page.port": port}


def test_the_fault_of_a_port_is_named_while_another_program_has_it():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert "in use" in port_fault("127.0.0.1", port)
    assert port_fault("127.0.0.1", port) == ""
