"""The contents of a bag are found by the ends of its files, and are those of all its messages."""

from serd_bag.formats.mcap.window import FileWindow
from serd_bag.health.contents import TopicContents, contents_of_bag
from serd_bag.writer import BagWriter


def test_contents_of_a_large_bag_need_only_its_end(tmp_path, monkeypatch):
    sizes, read = [], FileWindow.read
    monkeypatch.setattr(
        FileWindow, "read", lambda self, at, size: sizes.append(size) or read(self, at, size)
    )
    with BagWriter(tmp_path / "large", max_file_bytes=5_000_000) as writer:
        writer.add_topic("/blocks", "std_msgs/msg/UInt8MultiArray")
        for number in range(20):
            writer.write("/blocks", bytes(1_000_000), 10**9 * number)
    found = contents_of_bag(tmp_path / "large")
    assert found.topics == (TopicContents("/blocks", "std_msgs/msg/UInt8MultiArray", 20, 1.0),)
    assert found.span_s == 19.0
    assert 0 < sum(sizes) < 30_000
