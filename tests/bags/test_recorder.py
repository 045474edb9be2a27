"""The recorder keeps what was written when the disk fails, and counts episodes."""

import errno
import os
import re

import pytest

from serd_bag.errors import BagError
from serd_bag.reader import BagReader
from serd_bag.recorder import BagRecorder, LastSeconds, RecorderSettings
from support.bag_messages import DIAGNOSTICS, POSE


@pytest.fixture
def clock():
    """A clock that is set by hand."""

    def now():
        return now.now_s

    now.now_s = 0.0
    return now


def make(folder, clock, free_bytes=lambda _: 10**9, **settings):
    recorder = BagRecorder(
        folder, settings=RecorderSettings(**settings), clock=clock, free_bytes=free_bytes
    )
    recorder.add_topic("/robot_pose", POSE)
    recorder.add_topic("/episode", DIAGNOSTICS)
    return recorder


def test_messages_and_episodes_are_counted(tmp_path, clock, messages):
    recorder = make(tmp_path / "bag", clock)
    marks = [("start", ""), ("end", "arrived"), ("start", ""), ("end", "timeout"), ("start", "")]
    for number, (event, outcome) in enumerate(marks):
        assert recorder.record("/episode", messages.mark(number, event, number, outcome), number)
    status = recorder.close()
    assert recorder.close() == status
    assert (status.recording, status.problem, status.n_messages) == (False, "", 5)
    assert status.episodes_ended == 2
    assert status.outcomes == {"arrived": 1, "timeout": 1}
    assert len(list(BagReader(tmp_path / "bag").messages())) == 5


def test_recording_ends_with_a_sound_bag_before_the_disk_is_full(tmp_path, clock, messages):
    free = [10**9]
    recorder = make(tmp_path / "bag", clock, lambda _: free[0], min_free_bytes=1000)
    assert recorder.record("/robot_pose", messages.pose(1.0, 0.0, 0.0), 10**9)
    free[0], clock.now_s = 999, 1.1
    recorder.poll()
    assert not recorder.record("/robot_pose", messages.pose(2.0, 0.0, 0.0), 2 * 10**9)
    status = recorder.status
    assert not status.recording
    assert status.problem.endswith(
        "must have 1000 bytes free, got 999; recording ended, free some space"
    )
    assert status.n_lost == 1
    assert len(list(BagReader(tmp_path / "bag").messages())) == 1


def test_a_failed_write_is_reported_and_what_was_written_stays(
    tmp_path, clock, messages, monkeypatch
):
    recorder = make(tmp_path / "bag", clock, sync=False)

    def write(second):
        clock.now_s += 0.3
        written = recorder.record("/robot_pose", messages.pose(second, 0.0, 0.0), second * 10**9)
        recorder.poll()
        return written

    real, sizes = os.write, [20]

    def fill(descriptor, block):
        if not sizes:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(descriptor, bytes(block)[: sizes.pop()])

    assert write(1)
    with monkeypatch.context() as patched:
        patched.setattr(os, "write", fill)
        write(2)
    assert re.match("cannot write .*: the disk is full; free some space", recorder.status.problem)
    assert (recorder.status.n_messages, recorder.status.n_lost) == (1, 1)
    assert not write(3)
    recorder.close()
    found = list(BagReader(tmp_path / "bag", tolerant=True).messages())
    assert [message.log_time_ns for message in found] == [10**9]


def test_errors_of_the_caller_are_not_disk_faults(tmp_path, clock):
    recorder = make(tmp_path / "bag", clock)
    with pytest.raises(BagError, match="must be added first"):
        recorder.record("/other", b"", 1)
    assert recorder.status.recording
    recorder.close()


def test_files_are_split_by_size(tmp_path, clock, messages):
    recorder = make(tmp_path / "bag", clock, max_file_bytes=20_000)
    sizes = []
    for number in range(300):
        clock.now_s += 0.05
        recorder.record("/robot_pose", messages.pose(number, 0.0, 0.0), number)
        sizes.append(recorder.status.size_bytes)
    assert sizes == sorted(sizes)
    told_bytes = recorder.close().size_bytes
    sizes = [path.stat().st_size for path in (tmp_path / "bag").glob("*.mcap")]
    assert told_bytes == sum(sizes)
    assert len(sizes) > 2
    assert max(sizes) < 40_000
    assert len(list(BagReader(tmp_path / "bag").messages())) == 300


def test_a_snapshot_holds_what_is_neither_older_nor_larger_than_asked_for(tmp_path, clock):
    """A lasting message, as a map, stays until the bytes are too many."""
    last = LastSeconds(10.0, 50_000, clock=clock)

    def saved(name):
        last.save(tmp_path / name, [(topic, POSE, ()) for topic in ("/map", "/odom")])
        return [(each.data[0], each.log_time_ns) for each in BagReader(tmp_path / name).messages()]

    last.take("/map", bytes([0]), 0, 0, lasting=True)
    for number in range(1, 31):
        clock.now_s = float(number)
        last.take("/odom", bytes([number]), number, number)
    assert saved("all") == [(0, 20), *((number, number) for number in range(20, 31))]
    clock.now_s = 45.0
    assert saved("map") == [(0, 0)]
    for number in range(100):
        last.take("/odom", bytes([number] * 10_000), number, number)
    assert saved("large") == [(0, 96), *((number, number) for number in range(96, 100))]
    last.take("/map", bytes(60_000), 1, 1, lasting=True)
    assert saved("none") == []
