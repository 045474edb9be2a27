"""Missing messages are detected and counted by any part of the bag that still counts them."""

import re

import pytest
from mcap.writer import Writer

from serd_bag.command.rewrite import recover
from serd_bag.errors import BagError
from serd_bag.formats.mcap.chunks import CHUNK_PATTERN
from serd_bag.formats.mcap.writer import McapWriter
from serd_bag.formats.rosbag2.message_types import message_type
from serd_bag.health.check import check_bag
from serd_bag.health.contents import contents_of_bag
from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter

POSE = "geometry_msgs/msg/PoseStamped"


@pytest.fixture
def split_bag(tmp_path, messages):
    """A bag of 600 messages in several files."""
    with BagWriter(tmp_path / "split", max_file_bytes=30_000, flush_period_s=0.0) as writer:
        writer.add_topic("/robot_pose", POSE)
        for number in range(600):
            writer.write("/robot_pose", messages.pose(0.1 * number, number, 0.0), number)
    files = sorted((tmp_path / "split").glob("*.mcap"))
    assert len(files) > 4
    return tmp_path / "split"


def break_a_chunk(path):
    content = bytearray(path.read_bytes())
    content[CHUNK_PATTERN.search(content, len(content) // 2).end()] ^= 1
    path.write_bytes(content)


def cut(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def n_left(folder):
    return len(list(BagReader(folder, tolerant=True).messages()))


def test_losses_of_two_damaged_files_add_up(split_bag, tmp_path):
    cut(split_bag / "split_0.mcap")
    break_a_chunk(split_bag / "split_1.mcap")
    report = recover(split_bag, tmp_path / "new")
    assert report.n_messages == n_left(split_bag) < 598
    assert (report.n_lost, report.all_lost_known) == (600 - report.n_messages, True)


def test_without_metadata_what_a_cut_file_lost_is_not_known(split_bag, tmp_path):
    cut(split_bag / "split_0.mcap")
    break_a_chunk(split_bag / "split_1.mcap")
    (split_bag / "metadata.yaml").unlink()
    report = recover(split_bag, tmp_path / "new")
    assert 0 < report.n_lost < 600 - report.n_messages
    assert not report.all_lost_known


def test_messages_of_a_missing_file_are_lost(split_bag, tmp_path):
    (split_bag / "split_2.mcap").unlink()
    report = recover(split_bag, tmp_path / "new")
    assert report.n_lost == 600 - report.n_messages > 50
    assert report.all_lost_known


def test_metadata_without_a_list_of_files_gives_the_sum(split_bag, tmp_path):
    cut(split_bag / "split_0.mcap")
    path = split_bag / "metadata.yaml"
    path.write_text(re.sub(r"\n  files:.*?(?=\n  custom_data)", "", path.read_text(), flags=re.S))
    assert "  files:" not in path.read_text()
    report = recover(split_bag, tmp_path / "new")
    assert report.n_lost == 600 - report.n_messages > 0


def test_each_topic_is_compared_with_metadata(small_bag):
    folder = small_bag()
    path = folder / "metadata.yaml"
    text = path.read_text()
    assert text.count("message_count: 60") == 1
    assert text.count("message_count: 9") == 1
    swapped = text.replace("message_count: 60", "message_count: 59")
    path.write_text(swapped.replace("message_count: 9", "message_count: 10"))
    with pytest.raises(BagError, match="lists 10 messages on /intent, the files hold 9"):
        list(BagReader(folder).messages())
    assert len(check_bag(folder).faults) == 2


def test_each_topic_is_compared_with_the_statistics_of_an_mcap_file(small_bag, monkeypatch):
    summary = McapWriter._summary

    def swapped(writer, *arguments):
        counts = writer._statistics.channel_message_counts
        counts[1], counts[2] = counts[2], counts[1]
        return summary(writer, *arguments)

    monkeypatch.setattr(McapWriter, "_summary", swapped)
    folder = small_bag()
    with pytest.raises(BagError, match="9 messages were written on /robot_pose, 60 are there"):
        list(BagReader(folder / "small_0.mcap").messages())


def test_a_flipped_bit_in_an_index_is_a_fault_and_costs_no_message(small_bag):
    file = small_bag() / "small_0.mcap"
    content = bytearray(file.read_bytes())
    entries = [at.start() for at in re.finditer(rb"\x07.{7}\0", content, flags=re.S)]
    place = next(at for at in entries if content[at + 9 : at + 11] == b"\x01\0")
    content[place + 20] ^= 2
    file.write_bytes(content)
    assert len(list(BagReader(file).messages())) == 69
    (fault,) = check_bag(file).faults
    assert "the message index before this does not fit its chunk" in fault


def test_topics_are_found_where_the_summary_does_not_repeat_them(small_bag, monkeypatch):
    summary = McapWriter._summary

    def brief(writer, *arguments):
        writer._schemas, writer._channels = {}, []
        return summary(writer, *arguments)

    monkeypatch.setattr(McapWriter, "_summary", brief)
    check = check_bag(small_bag())
    assert check.sound
    assert {topic.name: topic.n_messages for topic in check.topics} == {
        "/robot_pose": 60,
        "/intent": 9,
    }


@pytest.mark.parametrize(
    ("listed", "wrong"),
    [
        ("message_count: 60", "message_count: 0"),
        ("message_count: 60", "message_count: 61"),
        ("message_count: 69", "message_count: 0"),
        ("message_count: 69", "message_count: 1000000000000"),
        ("relative_file_paths:\n  - small_0.mcap", "relative_file_paths: []"),
        ("relative_file_paths:\n  - small_0.mcap", "relative_file_paths: [small_1.mcap]"),
        ("  - small_0.mcap\n", "  - small_0.mcap\n  - small_0.mcap\n"),
    ],
)
def test_no_wrong_count_or_list_of_metadata_hides_a_message(small_bag, tmp_path, listed, wrong):
    folder = small_bag()
    path = folder / "metadata.yaml"
    assert listed in path.read_text()
    path.write_text(path.read_text().replace(listed, wrong))
    assert contents_of_bag(folder).n_messages == check_bag(folder).n_messages == 69
    assert not check_bag(folder).sound
    report = recover(folder, tmp_path / "new")
    assert (report.n_messages, bool(report.damage)) == (69, True)
    with pytest.raises(BagError, match="repair it with 'serd bag recover'"):
        list(BagReader(folder).messages())


def test_messages_that_cannot_be_given_are_lost_also_where_nothing_counts_them(tmp_path, messages):
    """Two of a time that no bag can hold, in a file without statistics."""
    path = tmp_path / "file.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, use_statistics=False)
        writer.start("ros2", "test")
        schema = writer.register_schema(POSE, "ros2msg", message_type(POSE).text.encode())
        channel = writer.register_channel("/pose", "cdr", schema)
        for time_ns in (1, 2, 3, 2**63, 2**64 - 1):
            writer.add_message(channel, time_ns, messages.pose(1.0, 0.0, 0.0), time_ns)
        writer.finish()
    report = recover(path, tmp_path / "new")
    assert (report.n_messages, report.n_lost, report.all_lost_known) == (3, 2, False)
    assert contents_of_bag(path).n_lost == check_bag(path).n_lost == 2
