"""Missing messages are detected and counted by any part of the bag that still counts them."""

import re
from pathlib import Path

import pytest

from serd_bag.errors import BagError
from serd_bag.formats.mcap.chunks import CHUNK_PATTERN
from serd_bag.formats.mcap.writer import McapWriter
from serd_bag.health.check import check_bag
from serd_bag.health.contents import contents_of_bag
from serd_bag.reader import BagReader
from serd_bag.rescue.saving import rescue
from serd_bag.writer import BagWriter
from support.bag_messages import POSE
from support.damaged_files import write_flipped


def break_a_chunk(path):
    content = path.read_bytes()
    write_flipped(path, content, CHUNK_PATTERN.search(content, len(content) // 2).end())


def cut(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def leave_out_the_files(path):
    """Of metadata.yaml, so that only the sum of all files is known."""
    path.write_text(re.sub(r"\n  files:.*?(?=\n  custom_data)", "", path.read_text(), flags=re.S))
    assert "  files:" not in path.read_text()


@pytest.mark.parametrize(
    ("damage", "all_known"),
    [
        ({"0.mcap": cut, "1.mcap": break_a_chunk}, True),
        ({"0.mcap": cut, "1.mcap": break_a_chunk, "metadata.yaml": Path.unlink}, False),
        ({"2.mcap": Path.unlink}, True),
        ({"0.mcap": cut, "metadata.yaml": leave_out_the_files}, True),
    ],
)
def test_losses_of_several_files_add_up_and_what_nothing_counts_is_not_known(
    tmp_path, messages, damage, all_known
):
    split_bag = tmp_path / "split"
    with BagWriter(split_bag, max_file_bytes=30_000, flush_period_s=0.0) as writer:
        writer.add_topic("/robot_pose", POSE)
        for number in range(600):
            writer.write("/robot_pose", messages.pose(0.1 * number, number, 0.0), number)
    for name, change in damage.items():
        change(split_bag / (name if name == "metadata.yaml" else f"split_{name}"))
    n_left = len(list(BagReader(split_bag, tolerant=True).messages()))
    report = rescue(split_bag, tmp_path / "new")
    assert report.n_messages - report.n_doubtful == n_left < 598
    n_missing = 600 - report.n_messages
    assert report.least_lost == n_missing if all_known else 0 <= report.least_lost < n_missing
    assert report.most_lost == (600 - n_left if all_known else None)


def test_each_topic_is_compared_with_the_statistics_of_an_mcap_file(small_bag, monkeypatch):
    summary = McapWriter._summary

    def swapped(writer, *arguments):
        writer._counts[1], writer._counts[2] = writer._counts[2], writer._counts[1]
        return summary(writer, *arguments)

    monkeypatch.setattr(McapWriter, "_summary", swapped)
    folder = small_bag()
    with pytest.raises(BagError, match="9 messages were written on /robot_pose, 60 are there"):
        list(BagReader(folder / "small_0.mcap").messages())


def test_a_flipped_bit_in_an_index_is_a_fault_and_costs_no_message(small_bag):
    file = small_bag() / "small_0.mcap"
    content = file.read_bytes()
    entries = [at.start() for at in re.finditer(rb"\x07.{7}\0", content, flags=re.S)]
    place = next(at for at in entries if content[at + 9 : at + 11] == b"\x01\0")
    write_flipped(file, content, place + 20, 1)
    assert len(list(BagReader(file).messages())) == 69
    (fault,) = check_bag(file).faults
    assert "the message index before this does not fit its chunk" in fault


@pytest.mark.parametrize(
    ("listed", "wrong", "sentence"),
    [
        ("message_count: 60", "message_count: 61", "lists 61 messages on /robot_pose, the files h"),
        ("message_count: 9", "message_count: 10", "lists 10 messages on /intent, the files hold 9"),
        ("message_count: 69", "message_count: 0", "lists 0 messages, the files hold 69"),
        ("message_count: 69", "message_count: 1000000000000", "the files hold 69"),
        ("paths:\n  - small_0.mcap", "paths: []", "does not list small_0.mcap"),
        ("paths:\n  - small_0.mcap", "paths: [small_1.mcap]", "small_1.mcap, which is missing"),
        ("  - small_0.mcap\n", "  - small_0.mcap\n  - small_0.mcap\n", "lists a file twice"),
    ],
)
def test_no_wrong_count_or_list_of_metadata_hides_a_message(
    small_bag, tmp_path, listed, wrong, sentence
):
    folder = small_bag()
    text = (folder / "metadata.yaml").read_text()
    assert text.count(listed) in (1, 2)
    (folder / "metadata.yaml").write_text(text.replace(listed, wrong, 1))
    assert contents_of_bag(folder).n_messages == check_bag(folder).n_messages == 69
    assert not check_bag(folder).sound
    report = rescue(folder, tmp_path / "new")
    assert (report.n_messages, bool(report.damage)) == (69, True)
    with pytest.raises(BagError, match=f"{sentence}.*; save what it holds with 'serd-bag rescue'"):
        list(BagReader(folder).messages())
