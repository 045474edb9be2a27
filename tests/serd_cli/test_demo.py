"""The folder of a demo run, in which nothing recorded is deleted, and the page beside the demo."""

from types import SimpleNamespace

import pytest

from serd_cli.demo import phases
from serd_cli.demo.folder import DemoSettings, new_folder, open_folder
from serd_cli.demo.phases import LivePage

ADDRESS = "http://127.0.0.1:8766/"


def test_runs_are_numbered_keep_their_settings_and_have_nothing_done(tmp_path):
    settings = DemoSettings(seed=9, demonstrations=2)
    first, second = new_folder(tmp_path, settings), new_folder(tmp_path, settings)
    assert [first.root.name, second.root.name] == ["run-1", "run-2"]
    folder, read = open_folder(second.root)
    assert (folder.root, read) == (second.root, settings)
    done = folder.demonstrated(settings), folder.learned(), folder.navigated(settings)
    assert done == (False, False, False)


def test_an_unfinished_bag_is_set_aside_under_a_name_of_its_own(tmp_path):
    folder = new_folder(tmp_path, DemoSettings())
    for content in ("one", "two"):
        folder.bag.mkdir()
        (folder.bag / "bag_0.mcap").write_text(content)
        folder.set_partial_bag_aside()
    kept = [(folder.root / f"bag.partial-{n}/bag_0.mcap").read_text() for n in (1, 2)]
    assert kept == ["one", "two"]
    assert not folder.bag.exists()


def test_the_time_of_a_phase_that_was_run_again_counts(tmp_path):
    folder = new_folder(tmp_path, DemoSettings())
    assert folder.wall_times_s() == {}
    for phase, wall_s in (("demonstrate", 2.0), ("learn", 1.0), ("demonstrate", 3.5)):
        folder.note_wall_time(phase, wall_s)
    assert open_folder(folder.root)[0].wall_times_s() == {"demonstrate": 3.5, "learn": 1.0}


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
