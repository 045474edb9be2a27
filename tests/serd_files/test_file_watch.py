"""A file is noticed once for every time it was written."""

from serd_bag.files import atomic_write_text
from serd_files.files import FileWatch


def test_every_writing_is_noticed_once(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text("one")
    watch = FileWatch(path)
    assert not watch.changed()
    atomic_write_text(path, "two")
    assert watch.changed()
    assert not watch.changed()


def test_a_file_that_is_gone_is_unchanged_until_it_is_back(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text("one")
    watch = FileWatch(path)
    path.unlink()
    assert not watch.changed()
    path.write_text("three")
    assert watch.changed()
