"""Files are written whole or not at all, and read where they are regular ones."""

import errno
import os
import stat
from pathlib import Path

import pytest

from serd_bag.errors import FileError
from serd_bag.files import (
    atomic_write_bytes,
    atomic_write_text,
    delete_file,
    read_bytes,
    read_text,
    require_file_place,
)
from serd_files.files import FileWatch


def failing(code):
    def fail(*_, **__):
        raise OSError(code, os.strerror(code))

    return fail


def test_the_content_is_written_folders_are_made_links_followed_and_the_mode_kept(tmp_path):
    target, link = tmp_path / "new" / "folder" / "target", tmp_path / "link"
    atomic_write_text(target, "grüße\n")
    assert target.read_bytes() == "grüße\n".encode()
    target.chmod(0o640)
    link.symlink_to(target)
    atomic_write_bytes(link, b"new")
    assert link.is_symlink()
    assert read_bytes(link) == target.read_bytes() == b"new"
    assert stat.S_IMODE(target.stat().st_mode) == 0o640


@pytest.mark.parametrize("step", ["fsync", "fchmod"])
@pytest.mark.parametrize(
    ("code", "sentence"),
    [(errno.ENOSPC, "the disk is full; free some space"), (errno.EROFS, "is read-only")],
)
def test_a_failure_keeps_the_old_content_and_leaves_no_temporary(
    tmp_path, monkeypatch, step, code, sentence
):
    path = tmp_path / "file"
    path.write_bytes(b"old")
    monkeypatch.setattr(os, step, failing(code))
    with pytest.raises(FileError, match=sentence):
        atomic_write_bytes(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_places_for_files_are_checked_before_they_are_written(tmp_path, monkeypatch):
    require_file_place(tmp_path / "new" / "folder" / "file")
    (tmp_path / "file").write_bytes(b"")
    for place, sentence in (
        (tmp_path, "it is a folder"),
        (tmp_path / "file" / "below", "a file of this name is in the way"),
        (tmp_path / "file" / "far" / "below", "a part of the path is a file"),
    ):
        with pytest.raises(FileError, match=sentence):
            require_file_place(place)
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(FileError, match="permission is denied"):
        require_file_place(tmp_path / "new")


def test_a_file_is_deleted_where_there_is_one_and_a_folder_gets_a_sentence(tmp_path, monkeypatch):
    path = tmp_path / "file"
    path.touch()
    delete_file(path)
    assert not path.exists()
    with pytest.raises(FileError, match=f"cannot delete {tmp_path}: "):
        delete_file(tmp_path)
    monkeypatch.setattr(Path, "unlink", failing(errno.EROFS))
    delete_file(path)
    path.touch()
    with pytest.raises(FileError, match="the file system is read-only; choose a folder"):
        delete_file(path)


def test_devices_pipes_folders_and_missing_files_are_rejected_before_they_are_opened(tmp_path):
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to("/dev/zero")
    for path, sentence in (
        *((path, f"{path} must be a regular file, got a device, pipe") for path in (pipe, link)),
        (tmp_path, "it is a folder; name a file"),
        (tmp_path / "other", "it does not exist; check the path"),
    ):
        for read in (read_bytes, read_text):
            with pytest.raises(FileError, match=sentence):
                read(path)


def test_every_writing_is_noticed_once_and_a_file_that_is_gone_when_it_is_back(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text("one")
    watch = FileWatch(path)
    assert [watch.changed(), watch.changed()] == [True, False]
    atomic_write_text(path, "two")
    assert [watch.changed(), watch.changed()] == [True, False]
    path.unlink()
    assert not watch.changed()
    path.write_text("three")
    assert watch.changed()
