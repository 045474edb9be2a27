"""The contents of a bag are found by the ends of its files, and are those of all its messages."""

import pytest

from serd_bag.formats.mcap.window import FileWindow
from serd_bag.health.check import check_bag, contents_of_bag
from serd_bag.writer import BagWriter


def counts(found):
    return {topic.name: (topic.type_name, topic.n_messages) for topic in found.topics}


def test_contents_of_a_large_bag_need_only_its_end(tmp_path, monkeypatch):
    sizes, locate = [], FileWindow.locate
    monkeypatch.setattr(
        FileWindow, "locate", lambda self, at, size: sizes.append(size) or locate(self, at, size)
    )
    with BagWriter(tmp_path / "large", max_file_bytes=5_000_000) as writer:
        writer.add_topic("/blocks", "std_msgs/msg/UInt8MultiArray")
        for number in range(20):
            writer.write("/blocks", bytes(1_000_000), 10**9 * number)
    found = contents_of_bag(tmp_path / "large")
    assert counts(found) == {"/blocks": ("std_msgs/msg/UInt8MultiArray", 20)}
    assert (found.span_s, found.topics[0].mean_hz) == (19.0, 1.0)
    assert sum(sizes) < 30_000


@pytest.mark.parametrize("change", ["whole", "cut", "no metadata"])
def test_contents_are_those_of_all_messages(small_bag, change):
    folder = small_bag(max_file_bytes=8000)
    if change == "cut":
        file = folder / "small_0.mcap"
        file.write_bytes(file.read_bytes()[:-100])
    if change == "no metadata":
        (folder / "metadata.yaml").unlink()
    found, check = contents_of_bag(folder), check_bag(folder)
    assert counts(found) == counts(check)
    assert found.faults == check.faults
    assert found.n_messages == 69
