"""Damaged files: no crash, no hang, and never a wrong result without a report of damage."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import MCAP0_MAGIC as MAGIC

from serd_bag.errors import BagError
from serd_bag.formats.mcap.records import RECORD_HEAD
from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter
from support.bag_messages import POSE
from support.damaged_files import write_wrong
from support.mcap_files import records


def read(path, tolerant):
    reader = BagReader(path, tolerant=tolerant)
    return list(reader.messages()), reader.damage


def record_starts(content):
    return [start - RECORD_HEAD.size for _, start in records(content)]


@pytest.fixture(params=["none", "zstd"])
def whole(small_bag, request):
    """(path of the MCAP file, its bytes, its messages)."""
    path = small_bag(compression=request.param) / "small_0.mcap"
    return path, path.read_bytes(), read(path, False)[0]


def test_a_file_cut_anywhere_gives_the_first_messages_and_reports_damage(whole):
    path, content, messages = whole
    counts = []
    for size in [*range(0, len(content), 197), len(content) - 1]:
        path.write_bytes(content[:size])
        found, damage = read(path, True)
        assert found == messages[: len(found)]
        assert damage
        if not all(each.is_harmless for each in damage):
            with pytest.raises(BagError, match=r"at byte \d+: .*rescue"):
                read(path, False)
        else:  # of the summary alone
            assert read(path, False)[0] == found == messages
        counts.append(len(found))
    assert counts == sorted(counts)
    assert counts[-1] == len(messages)


def test_wrong_bytes_are_detected_or_harmless_and_a_bit_costs_its_chunk_alone(whole):
    path, content, messages = whole
    rng = np.random.default_rng(5)
    heads = np.concatenate([np.arange(start, start + 9) for start in record_starts(content)])
    places = np.concatenate([heads, rng.integers(len(content), size=200)])
    changes = [(place, bytes([content[place] ^ 1 << rng.integers(8)])) for place in places]
    changes += [  # as power loss leaves them
        (place, bytes(min(rng.integers(16, 4096), len(content) - place)))
        for place in rng.integers(8, len(content), size=40)
    ]
    for place, wrong in changes:
        write_wrong(path, content, place, wrong)
        found, damage = read(path, True)
        assert set(found) <= set(messages)
        assert len(messages) - len(found) in range(13 if len(wrong) == 1 else 70), place
        assert damage or found == messages == read(path, False)[0], place


def test_damage_of_an_unfinished_recording_costs_only_the_chunks_it_touches(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/robot_pose", POSE)
        for number in range(120):
            writer.write("/robot_pose", bytes([number]) * 600, number)
            if number % 10 == 9:
                writer.flush()
    path = tmp_path / "bag" / "bag_0.mcap"
    starts = record_starts(path.read_bytes())
    content = path.read_bytes()
    content = content[: next(start for start in starts if content[start] == 0x0C)]
    path.write_bytes(content)
    messages = read(path, True)[0]
    heads = {start + place for start in starts if start < len(content) for place in range(0, 50, 7)}
    flips = [(place, bytes([content[place] ^ 1 << place % 8])) for place in sorted(heads)]
    pages = [(place, bytes(4096)) for place in range(0, len(content) - 4096, 4096)]
    for place, wrong in (*flips, *pages, (len(content) - 4096, bytes(4096))):
        write_wrong(path, content, place, wrong)
        found, damage = read(path, True)
        assert damage
        assert set(found) <= set(messages)
        assert len(found) == len(set(found)) >= len(messages) - 20


@settings(max_examples=100, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.binary(max_size=300), st.sampled_from([b"", MAGIC, MAGIC + b"\x01\x08" + bytes(15)]))
def test_no_bytes_at_all_crash_the_reader(tmp_path_factory, tail, head):
    path = tmp_path_factory.mktemp("noise") / "noise.mcap"
    path.write_bytes(head + tail)
    found, damage = read(path, True)
    assert (found, bool(damage)) == ([], True)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("file.mcap", b"", "the file is empty"),
        ("file.mcap", b"SQLite format 3\0" * 10, "not a database"),
        ("file.mcap", b"SQLite format 2\0" * 10, "an MCAP file begins with"),
        ("file.mcap", MAGIC, "the recording was cut off here"),
        ("file.mcap", MAGIC + b"\0" * 1000, "no record begins with"),
        ("file.mcap", MAGIC + b"\xff" * 1000, "the file ends within a record"),
        ("file.mcap", MAGIC + MAGIC, "the recording was cut off here"),
        ("file.db3", b"", "no such table"),
        ("file.db3", bytes(9000), "not a database"),
        ("file.db3", b"SQLite format 3\0" + bytes(9000), "the database"),
        ("file.bag", b"", "seems to be empty; record it again$"),
        ("file.bag", b"#ROSBAG V1.2\n", "Bag version 102 is not supported"),
        ("file.bag", b"#ROSBAG V2.0\n", "; 'rosbag reindex' of ROS 1 may repair it$"),
    ],
)
def test_a_file_that_is_no_recording_raises(tmp_path, name, content, message):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(BagError, match=message):
        read(path, False)
    found, damage = read(path, True)
    assert (found, bool(damage)) == ([], True)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (None, "metadata.yaml: it does not exist"),
        ("", "it must have the key rosbag2_bagfile_information with keys and values"),
        ("[", "is no rosbag2 metadata"),
        ("a: 1", "it must have the key rosbag2_bagfile_information with keys and values"),
        ("\0", "is no rosbag2 metadata"),
        ("rosbag2_bagfile_information: 3", "it must have the key rosbag2_bagfile_information with"),
        ("rosbag2_bagfile_information: {}", "relative_file_paths must be a list of names"),
    ],
)
def test_a_bag_with_broken_or_without_metadata_is_read_and_reported(small_bag, text, sentence):
    folder = small_bag(max_file_bytes=4000)
    messages = read(folder, False)[0]
    (folder / "metadata.yaml").unlink()
    if text is not None:
        (folder / "metadata.yaml").write_text(text)
    with pytest.raises(BagError, match=sentence):
        read(folder, False)
    found, damage = read(folder, True)
    assert (found, len(damage)) == (messages, 1)


def test_missing_and_foreign_files_raise(small_bag, tmp_path):
    folder = small_bag()
    (folder / "small_0.mcap").rename(folder / "other_0.mcap")
    for name in ("empty", "ros_1"):
        (tmp_path / name).mkdir()
    (tmp_path / "ros_1" / "old.bag").touch()
    for path, sentence in (
        (tmp_path / "ros_1", "holds bags of ROS 1; give each of them, as .*/ros_1/old.bag"),
        (folder, r"lists small_0.mcap, which is missing"),
        (tmp_path / "nowhere", r"must be a folder or a .mcap, .db3 or .bag file"),
        (tmp_path / "empty", r"must hold .mcap or .db3 files, got none"),
    ):
        with pytest.raises(BagError, match=sentence):
            read(path, False)
