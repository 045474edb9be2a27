"""The folder of a demo run: numbered, continued, nothing recorded is deleted."""

import pytest

from serd_bag.errors import FileError
from serd_cli.demo.folder import DemoSettings, new_folder, open_folder
from serd_cli.errors import UsageError


def test_runs_are_numbered_and_keep_their_settings(tmp_path):
    settings = DemoSettings(seed=9, demonstrations=2)
    first, second = new_folder(tmp_path, settings), new_folder(tmp_path, settings)
    assert [first.root.name, second.root.name] == ["run-1", "run-2"]
    folder, read = open_folder(second.root)
    assert (folder.root, read) == (second.root, settings)


def test_a_new_run_has_nothing_done(tmp_path):
    settings = DemoSettings()
    folder = new_folder(tmp_path, settings)
    assert not folder.demonstrated(settings)
    assert not folder.learned()
    assert not folder.navigated(settings)


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


def test_a_file_in_place_of_the_output_folder_gets_a_sentence(tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises((UsageError, FileError), match="out"):
        new_folder(tmp_path / "out", DemoSettings())


def test_a_folder_that_is_no_run_gets_a_sentence(tmp_path):
    with pytest.raises(UsageError, match="is no demo run"):
        open_folder(tmp_path)
